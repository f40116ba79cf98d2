"""The wish for how a simulated twin is to be."""

from __future__ import annotations

from typing import Annotated

import msgspec


class WireConditions(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The wire between gateway and board: frames arrive in order, or not at all.

    Status, events, configuration and heartbeats are never lost: a broker keeps them, or repeats them.
    """

    delay: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.001  # [s]
    jitter: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0  # [s] more, uniformly distributed
    loss: Annotated[float, msgspec.Meta(ge=0.0, lt=1.0)] = 0.0  # probability
