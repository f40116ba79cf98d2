"""The legs of a program carried out one after another, each planned while the one before moves."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from threading import Event

from gemelo.api.arm import Arm
from gemelo.api.errors import Aborted, Error, Refused
from gemelo.api.motion import Motion
from gemelo.api.planning import Plan
from gemelo.programs.demonstrations import demonstrations_of, play_demonstration
from gemelo.programs.planning import plan_leg
from gemelo.programs.points import Point
from gemelo.programs.sequence import Leg
from gemelo.programs.steps import Attach, Detach, Grip, Output, Pick, Play, Wait, WaitFor
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.reasons import Reason, because

LOOK_AHEAD = 50  # legs that are looked through for the next motion
HAND_OVER = 1.0  # [s] before the end of a motion that the next is handed over; the gateway sends 0.5 s ahead at most
SENSOR_PERIOD = 0.05  # [s] between two looks at a sensor, of which there are 10 a second

OnLeg = Callable[[Leg | None, int, int, Reason | None], object]  # the leg, legs done, legs planned, why it pauses


class Failed(Error):
    """A step that could not be carried out."""


@dataclass
class Controls:
    """What a person wants, written by his thread and read by that of the run."""

    pauses: bool = False  # at the end of the present leg
    pauses_after_one: bool = False
    holds: bool = False  # on the path
    stop: Event = field(default_factory=Event)  # the arm decelerates, and the run is over

    @property
    def wants_pause(self) -> bool:
        """True if no other leg is to begin; a hold may come when the motion has just ended."""
        return self.pauses or self.holds


@dataclass
class Prepared:
    """A motion that comes later: its plan, and the motion itself where the gateway has it already."""

    leg: Leg
    plan: Plan | None = None
    motion: Motion | None = None


class Execution:
    """One run, in the thread of the one who calls `run`."""

    def __init__(
        self, arm: Arm, legs: Iterator[Leg], points: Mapping[str, Point], controls: Controls, on_leg: OnLeg
    ) -> None:
        self._arm, self._legs, self._points, self._controls, self._on_leg = arm, legs, points, controls, on_leg
        self._queue: deque[Leg] = deque()
        self.following: Prepared | None = None  # the next leg, with its motion once that is handed over
        self._motion: Motion | None = None
        self.is_starting = False  # True while a motion is handed over: the arm may move, and `is_moving` not know it
        self.leg: Leg | None = None  # that is carried out, or was the last
        self._done = self._planned = 0

    @property
    def is_moving(self) -> bool:
        motion = self._motion
        return motion is not None and not motion.is_over

    def cancel(self) -> None:
        """The arm decelerates; from any thread."""
        for motion in (self.following.motion if self.following is not None else None, self._motion):
            if motion is not None and not motion.is_over:
                motion.cancel()

    def run(self) -> None:
        """Returns at the end of the program or when a person has stopped it; raises `Failed`."""
        while (leg := self._take()) is not None:
            self._pause_if_asked(leg)
            if self._controls.stop.is_set():
                return
            self.leg = leg
            self._tell(leg)
            try:
                self._carry_out(leg)
            except Error as error:
                if self._controls.stop.is_set():
                    return
                raise Failed(error.reason) from error
            if self._controls.stop.is_set():
                return
            self._done += len(leg.steps)
            self._controls.pauses |= self._controls.pauses_after_one
        self._tell(None)

    def _pause_if_asked(self, leg: Leg) -> None:
        handed_over = self.following is not None and self.following.leg is leg and self.following.motion is not None
        if handed_over or not self._controls.wants_pause:
            return
        self._on_leg(leg, self._done, self._planned, because("program.run.paused"))
        self._arm.wait_for(lambda: self._controls.stop.is_set() or not self._controls.wants_pause, None)

    def _carry_out(self, leg: Leg) -> None:
        step = leg.steps[0]
        match step:
            case Output():
                self._arm.output(step.name, step.on)
            case Grip():
                self._arm.grip(step.to, is_cancelled=self._controls.stop.is_set)
            case Pick():
                stopped = self._controls.stop.is_set
                self._arm.pick(step.thing, to=step.place, camera=step.camera, is_cancelled=stopped)
            case Play():
                shown = demonstrations_of(self._arm).require(step.demonstration)
                play_demonstration(self._arm, shown, step.share, self._controls.stop.is_set)
            case Wait():
                self._arm.wait_for(self._controls.stop.is_set, step.time)
            case WaitFor():
                self._wait_for(step)
            case Attach():
                self._arm.scene.attach(step.object, step.link or self._arm.tool_frame, step.touch)
            case Detach():
                self._arm.scene.detach(step.object)
            case _:
                self._move(leg)

    def _wait_for(self, step: WaitFor) -> None:
        clock = self._arm.node
        end = clock.monotonic() + step.timeout
        while not self._controls.stop.is_set():
            value = self._arm.sensors.get(step.sensor)
            if value is not None and _is_met(step, value):
                return
            if clock.monotonic() >= end:
                raise Failed(_not_met(step, value))
            self._arm.wait_for(self._controls.stop.is_set, SENSOR_PERIOD)

    def _move(self, leg: Leg) -> None:
        prepared, self.following = self.following, None
        if prepared is None or prepared.leg is not leg:
            prepared = Prepared(leg)
        self.is_starting = prepared.motion is not None
        motion = prepared.motion or self._start(leg, prepared.plan)
        try:
            self._follow(motion)
        except Aborted as aborted:
            was_handed_over = motion is prepared.motion
            if not was_handed_over or aborted.code != FollowErrorCode.SCENE_CHANGED or self._controls.stop.is_set():
                raise
            self._follow(self._start(leg, None))  # the scene has changed since it was handed over

    def _follow(self, motion: Motion) -> None:
        """To its end; the next motion is planned meanwhile, and handed over when this one is near its end."""
        self._motion = motion
        if self._controls.stop.is_set():
            motion.cancel()  # asked for while it was being started
        elif self._controls.holds:  # so was this
            with suppress(Refused):  # it has ended already
                self._arm.hold()
        self.is_starting = False
        self._prepare_handover(motion)
        motion.wait()

    def _prepare_handover(self, motion: Motion) -> None:
        following = self._prepare_next(motion)
        while following is not None and not motion.is_over and not self._controls.stop.is_set():
            if self._wants_to_hand_over(motion):
                return self._hand_over(motion, following)
            self._arm.wait_for(partial(self._is_time_to_look, motion), None)

    def _is_time_to_look(self, motion: Motion) -> bool:
        return motion.is_over or self._controls.stop.is_set() or self._wants_to_hand_over(motion)

    def _wants_to_hand_over(self, motion: Motion) -> bool:
        will_pause = self._controls.wants_pause or self._controls.pauses_after_one
        return not will_pause and motion.plan.duration - motion.elapsed <= HAND_OVER

    def _hand_over(self, motion: Motion, following: Prepared) -> None:
        """The gateway appends it to the present motion; what it refuses is planned anew in its turn."""
        try:
            following.motion = self._arm.start(following.plan, after=motion)
        except Refused:
            following.plan = None
        if self._controls.stop.is_set():
            self.cancel()

    def _start(self, leg: Leg, plan: Plan | None) -> Motion:
        """Along the plan if that still leads from here, else along a new one."""
        if plan is not None:
            try:
                return self._begin(plan)
            except Refused:
                pass  # moved by hand meanwhile, or the scene is another
        return self._begin(self._plan(leg, None))

    def _begin(self, plan: Plan) -> Motion:
        self.is_starting = True
        try:
            return self._arm.start(plan)
        except BaseException:
            self.is_starting = False
            raise

    def _prepare_next(self, motion: Motion) -> Prepared | None:
        """Plans the next motion from the end of this one; returns it where it follows at once."""
        leg = self._upcoming()
        if leg is None or self._controls.stop.is_set():
            return None
        try:
            self.following = Prepared(leg, self._plan(leg, motion.plan.end))
        except Error:
            return None  # it is planned once more when its turn comes, and refused then if it must be
        return self.following if self._peek(0) is leg else None

    def _plan(self, leg: Leg, start: Mapping[str, float] | None) -> Plan:
        plan = plan_leg(self._arm, leg, self._points, start)
        self._planned += 1
        return plan

    def _upcoming(self) -> Leg | None:
        for index in range(LOOK_AHEAD):
            leg = self._peek(index)
            if leg is None or isinstance(leg.steps[0], Attach | Detach | Grip | Pick | Play):
                return None
            if leg.is_motion:
                return leg
        return None

    def _peek(self, index: int) -> Leg | None:
        while len(self._queue) <= index:
            leg = next(self._legs, None)
            if leg is None:
                return None
            self._queue.append(leg)
        return self._queue[index]

    def _take(self) -> Leg | None:
        leg = self._peek(0)
        if leg is not None:
            self._queue.popleft()
        return leg

    def _tell(self, leg: Leg | None) -> None:
        self._on_leg(leg, self._done, self._planned, None)


def _is_met(step: WaitFor, value: float) -> bool:
    return (step.above is not None and value > step.above) or (step.below is not None and value < step.below)


def _not_met(step: WaitFor, value: float | None) -> Reason:
    sensor, time = step.sensor, step.timeout
    if step.above is not None:
        if value is None:
            return because("program.sensor.silent_above", sensor=sensor, limit=step.above, time=time)
        return because("program.sensor.not_above", sensor=sensor, value=value, limit=step.above, time=time)
    assert step.below is not None
    if value is None:
        return because("program.sensor.silent_below", sensor=sensor, limit=step.below, time=time)
    return because("program.sensor.not_below", sensor=sensor, value=value, limit=step.below, time=time)
