"""The plan that is shown and the motion under way: one of each for all browsers, so that people see one another's."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import gemelo
from gemelo.services.panel.model.problems import Problem, problem_of

AFTER_STOP = 0.7  # [s] chosen: a press that the same finger makes with Stop starts nothing
ALLOWED_TIME = 5.0  # [s] for planning
PATIENCE = 2.0 * ALLOWED_TIME  # [s] for a plan that is being made


@dataclass(frozen=True)
class MotionChoice:
    """How to go to a goal."""

    line: bool = False  # the tool on a straight line; else any way that is free
    speed: float = 1.0  # share of the limits, in (0, 1]
    planner: str = ""  # a name of gemelo.schemas.planners; empty: the default

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
        self._news = threading.Condition()
        self._asked = 0  # presses on Plan whose plan is not made yet
        self._stopped = 0.0  # [s] monotonic, of the last press on Stop
        self._stops = 0
        self._led: gemelo.Plan | None = None  # the last one that was made to be executed at once
        self.plan: gemelo.Plan | None = None
        self.motion: gemelo.Motion | None = None
        self._executed: gemelo.Plan | None = None  # the last one that the arm has begun to go along
        self.shows_plan = False  # by a ghost that goes along it: until it is executed, and again when a person asks
        self.version = 0  # +1 with every change

    @property
    def is_moving(self) -> bool:
        """True while a motion of the page is under way."""
        motion = self.motion
        return motion is not None and not motion.is_over

    @property
    def is_planning(self) -> bool:
        """True while a plan is made, or has been asked for."""
        return self._one.locked() or self._asked > 0

    @property
    def has_plan_to_execute(self) -> bool:
        """True for a plan along which the arm has not gone yet, or one that is being made."""
        return self.is_planning or (self.plan is not None and self.plan is not self._executed)

    def ask(self) -> None:
        """A plan was asked for by a press: the one before is none any more, and an Execute that follows waits.

        `make_asked` or `make_asked_and_execute` is to follow.
        """
        with self._news:
            self._asked += 1
        self.plan = None
        self._changed()

    def make_asked(self, target: Callable[[], gemelo.Target]) -> gemelo.Plan | None:
        """As `make`, of the target that there is by then, for one `ask`."""
        try:
            return self.make(target())
        finally:
            self._made()

    def make(self, target: gemelo.Target) -> gemelo.Plan | None:
        """Plans, and shows the plan; None and a problem told where there is none."""
        if not self._one.acquire(blocking=False):
            self._tell(Problem("busy", "busy"))
            return None
        try:
            self.plan = None
            self._changed()
            self.plan = self._arm.plan(**target)
            self.shows_plan = True
        except Exception as error:
            self._tell(problem_of(error))
        finally:
            self._one.release()
            self._changed()
        return self.plan

    def execute(self, plan: gemelo.Plan | None = None) -> gemelo.Motion | None:
        """Goes exactly along `plan`, or the plan that is shown, and returns at its end; None if it did not begin.

        Where one is being made it is waited for; why there is none is told by then.
        """
        if self.has_just_stopped:
            return None
        stops, had_to_wait = self._stops, self.is_planning
        with self._news:
            self._news.wait_for(lambda: plan is not None or not self.is_planning, PATIENCE)
        plan = plan or self.plan
        if had_to_wait and plan is not None and plan is self._led:
            return None
        if plan is not None:
            return self._go(plan, stops)
        if not had_to_wait:
            self._tell(Problem("no plan", "no plan"))
        return None

    def make_and_execute(self, target: gemelo.Target) -> gemelo.Motion | None:
        """Both; a Stop meanwhile ends it before it moves."""
        if self.has_just_stopped:
            return None
        stops = self._stops
        plan = self.make(target)
        return self._go(plan, stops) if plan is not None else None

    def make_asked_and_execute(self, target: Callable[[], gemelo.Target]) -> gemelo.Motion | None:
        """As `make_and_execute`, of the target that there is by then, for one `ask`."""
        stops, has_just_stopped, plan = self._stops, self.has_just_stopped, None
        try:
            made = self.make(target())
            if not has_just_stopped and stops == self._stops:  # else the plan is only shown
                plan = made
        finally:
            self._made(plan)
        return self._go(plan, stops) if plan is not None else None

    def on_stop(self) -> None:
        """What is asked for just now, and what is being planned, does not begin."""
        self._stopped = time.monotonic()
        self._stops += 1

    def forget_plan(self) -> None:
        """The plan is shown no more."""
        self.plan = None
        self._changed()

    @property
    def has_just_stopped(self) -> bool:
        """True for a moment after a Stop, in which no press starts anything."""
        return time.monotonic() - self._stopped < AFTER_STOP

    def _made(self, led: gemelo.Plan | None = None) -> None:
        """What was asked for is made; `led` is executed by who has asked."""
        with self._news:
            self._asked, self._led = self._asked - 1, led or self._led
        self._changed()

    def _go(self, plan: gemelo.Plan, stops: int) -> gemelo.Motion | None:
        if stops != self._stops:
            return None
        motion: gemelo.Motion | None = None
        try:
            motion = self.motion = self._arm.start(plan)
            self._executed, self.shows_plan = plan, False
            self._changed()
            motion.wait()
        except Exception as error:
            self._tell(problem_of(error))
        finally:
            self._changed()
        return motion

    def _changed(self) -> None:
        with self._news:
            self.version += 1
            self._news.notify_all()
