"""The progress of a homing while it runs, and its report at the end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gemelo.schemas.reasons import Reason

WAITS, TO, OFF, HOME = "waits", "to its switch", "off its switch", "home"


class HomingProgress(dict[str, str]):
    """What each joint does, by name: "waits", "to its switch", "off its switch" or "home".

    >>> told = []
    >>> arm.home("efector_joint", on_progress=told.append).homed
    ('efector_joint',)
    >>> told[-1], abs(told[-1].steps_off["efector_joint"]) <= 1, told[-1].elapsed > 0.0
    ({'efector_joint': 'home'}, True, True)
    """

    def __init__(self, phases: Mapping[str, str], steps_off: Mapping[str, int], elapsed: float) -> None:
        super().__init__(phases)
        self.steps_off = dict(steps_off)  # of joints that are home, and whose place had been known before
        self.elapsed = elapsed  # [s]


@dataclass(frozen=True)
class HomingReport:
    """How a homing ended: which joints are home, and how many steps their counters had been off.

    >>> report = arm.home("efector_joint")
    >>> report.homed, abs(report.steps_off["efector_joint"]) <= 1
    (('efector_joint',), True)
    """

    homed: tuple[str, ...]
    steps_off: dict[str, int]  # of joints whose place had been known before
    took: float  # [s]
    reason: str = ""  # why not all are home, where an error carries the report
    why: Reason | None = None  # the same as data
