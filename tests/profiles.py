"""The number of examples of a property: some in `make test`, all in `make test-all` (HYPOTHESIS_PROFILE=full)."""

from __future__ import annotations

import os
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "quick")
QUICK = 50  # of a cheap property, which are most
ALL = 100


def load() -> None:
    """The same examples everywhere; HYPOTHESIS_PROFILE=explore looks for new ones."""
    # No deadline, and no example is drawn too slowly: two cores, shared; time is measured by the bench.
    untimed: dict[str, Any] = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
    settings.register_profile("quick", derandomize=True, max_examples=QUICK, **untimed)
    settings.register_profile("full", derandomize=True, max_examples=ALL, **untimed)
    settings.register_profile("explore", max_examples=ALL, **untimed)
    settings.load_profile(PROFILE)
    if PROFILE != "explore":  # not those with the numbers of whatever modules happen to be loaded
        providers._get_local_constants = lambda: providers._local_constants


def examples(*, quick: int = QUICK, full: int = ALL, **others: Any) -> settings:
    """The settings of a property whose examples are dear, or that needs more of them than others."""
    return settings(max_examples=quick if PROFILE == "quick" else full, **others)


def count(*, quick: int, full: int) -> int:
    """How many cases a test has that is marked `scaled`: as of a property, all of them in `make test-all`."""
    return quick if PROFILE == "quick" else full
