"""The plan that is shown and the motion under way: one of each for all browsers, so that people see one another's."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import gemelo
from services.panel.model.problems import Problem, problem_of

AFTER_STOP = 0.7  # [s] chosen: a press that the same finger makes with Stop starts nothing
ALLOWED_TIME = 5.0  # [s] for planning
PLANNERS = ("", "native", "RRTConnect", "RRTstar", "BITstar", "PRM")


@dataclass(frozen=True)
class MotionChoice:
    """How to go to a goal."""

    line: bool = False  # the tool on a straight line; else any way that is free
    speed: float = 1.0  # share of the limits, in (0, 1]
    planner: str = ""  # of PLANNERS; empty: the default

    def target(self, joints: dict[str, float]) -> gemelo.Target:
        """To these joint values, [rad] or [m]."""
        target = gemelo.Target(joints=joints, speed=self.speed, allowed_time=ALLOWED_TIME)
        if self.line:
            target["line"] = True
        elif self.planner:
            target["planner"] = self.planner
        return target


class Motions:
    """Plans and executes, one thing at a time. Every method returns when its work is done, and tells errors."""

    def __init__(self, arm: gemelo.Arm, tell: Callable[[Problem], object]) -> None:
        self._arm, self._tell = arm, tell
        self._one = threading.Lock()
        self._stopped = 0.0  # [s] monotonic, of the last press on Stop
        self._stops = 0
        self.plan: gemelo.Plan | None = None
        self.motion: gemelo.Motion | None = None
        self.is_planning = False
        self.shows_plan = False  # by a ghost that goes along it: until it is executed, and again when a person asks
        self.version = 0  # +1 with every change

    @property
    def is_moving(self) -> bool:
        """True while a motion of the page is under way."""
        motion = self.motion
        return motion is not None and not motion.is_over

    def make(self, target: gemelo.Target) -> gemelo.Plan | None:
        """Plans, and shows the plan; None and a problem told where there is none."""
        if not self._one.acquire(blocking=False):
            self._tell(Problem("busy", "busy"))
            return None
        try:
            self.is_planning, self.plan = True, None
            self._changed()
            self.plan = self._arm.plan(**target)
            self.shows_plan = True
        except Exception as error:
            self._tell(problem_of(error))
        finally:
            self.is_planning = False
            self._one.release()
            self._changed()
        return self.plan

    def execute(self, plan: gemelo.Plan | None = None) -> gemelo.Motion | None:
        """Goes exactly along `plan`, or the plan that is shown, and returns at its end; None if it did not begin."""
        plan = plan or self.plan
        if plan is None:
            self._tell(Problem("no plan", "no plan"))
            return None
        if time.monotonic() - self._stopped < AFTER_STOP:
            return None
        return self._go(plan, self._stops)

    def make_and_execute(self, target: gemelo.Target) -> gemelo.Motion | None:
        """Both; a Stop meanwhile ends it before it moves."""
        if time.monotonic() - self._stopped < AFTER_STOP:
            return None
        stops = self._stops
        plan = self.make(target)
        return self._go(plan, stops) if plan is not None else None

    def on_stop(self) -> None:
        """What is asked for just now, and what is being planned, does not begin."""
        self._stopped = time.monotonic()
        self._stops += 1

    def forget_plan(self) -> None:
        """The plan is shown no more."""
        self.plan = None
        self._changed()

    def _go(self, plan: gemelo.Plan, stops: int) -> gemelo.Motion | None:
        if stops != self._stops:
            return None
        motion: gemelo.Motion | None = None
        try:
            motion = self.motion = self._arm.start(plan)
            self.shows_plan = False
            self._changed()
            motion.wait()
        except Exception as error:
            self._tell(problem_of(error))
        finally:
            self._changed()
        return motion

    def _changed(self) -> None:
        self.version += 1
