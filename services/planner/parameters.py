"""The parameters of the planner."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta


class PlannerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """What a person may switch off."""

    record_inputs: Annotated[
        bool, Meta(description="publish what answers and jogs are made from, so that a recording can be replayed")
    ] = True
