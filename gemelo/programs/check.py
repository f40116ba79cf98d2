"""A whole program planned before it runs: every leg from the end of the one before."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from gemelo.api.arm import Arm
from gemelo.api.errors import BadArgument, Refused
from gemelo.programs.demonstrations import demonstrations_of, require_free, require_same_arm
from gemelo.programs.meaning import find_mistakes
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.planning import plan_leg
from gemelo.programs.points import Point
from gemelo.programs.program import Program
from gemelo.programs.sequence import Leg, legs_of, lost_blend
from gemelo.programs.steps import (
    Attach,
    Detach,
    Grip,
    MotionStep,
    Pick,
    Play,
    StepPath,
    Wait,
    WaitFor,
    path_text,
    words_of,
)
from gemelo.schemas.reasons import Reason, because

SAME = 1e-6  # [rad] or [m] between two states that are one
MOST_LEGS = 5_000  # that one check plans
MOST_CARRIED_OUT = 200_000  # that one check follows: a few seconds


@dataclass(frozen=True)
class CheckedLeg:
    """One step, or the motions that are blended into one, and what became of its plan."""

    paths: tuple[StepPath, ...]  # of its steps
    rounds: tuple[int, ...]  # from 0, of every repeat around it
    text: str  # what it does
    duration: float = 0.0  # [s] planned, or waited; 0 where it is not known
    margins: Mapping[str, float] = field(default_factory=dict)  # by joint, the share of its stepper that is left
    planner: str = ""  # that found the path
    planning_time: float = 0.0  # [s]
    refusal: Refused | None = None  # why there is no plan
    notes: tuple[Reason, ...] = ()  # what a person should know
    times: int = 1  # how often it is carried out like this: a repeat whose rounds are alike is planned once

    @property
    def path(self) -> StepPath:
        return self.paths[0]

    @property
    def ok(self) -> bool:
        return self.refusal is None

    @property
    def note(self) -> str:
        """The notes in one line."""
        return "; ".join(map(str, self.notes))

    @property
    def tightest(self) -> tuple[str, float]:
        """The joint with the smallest margin, and the margin as a share of its limit; ("", 1.0) where nothing moves."""
        return min(self.margins.items(), key=lambda each: each[1], default=("", 1.0))


@dataclass(frozen=True)
class ProgramCheck:
    """What a check has found."""

    program: str
    mistakes: tuple[Mistake, ...]  # of the files; with any of them nothing is planned
    legs: tuple[CheckedLeg, ...]
    left_out: Reason | None = None  # what was not planned

    @property
    def ok(self) -> bool:
        """True if the whole program can run from here."""
        return not self.mistakes and all(leg.ok for leg in self.legs)

    @property
    def duration(self) -> float:
        """[s] of all motions and waiting times, as often as they are carried out; sensors are not waited for."""
        return sum(leg.duration * leg.times for leg in self.legs)

    @property
    def note(self) -> str:
        """What was not planned, in one sentence; empty where everything was."""
        return str(self.left_out or "")

    @property
    def refusals(self) -> tuple[Reason, ...]:
        """Why each leg that was refused was."""
        return tuple(
            because("program.step.failed", leg.refusal.reason, step=path_text(leg.path), text=leg.text)
            for leg in self.legs
            if leg.refusal
        )

    @property
    def margins(self) -> dict[str, float]:
        """By joint, the smallest share of its stepper that is left on any leg."""
        found: dict[str, float] = {}
        for leg in self.legs:
            for name, margin in leg.margins.items():
                found[name] = min(margin, found.get(name, 1.0))
        return found


def check_program(
    arm: Arm,
    program: Program,
    points: Mapping[str, Point],
    programs: Mapping[str, Program],
    *,
    first: StepPath = (),
    start: Mapping[str, float] | None = None,
    on_leg: Callable[[CheckedLeg], object] | None = None,
) -> ProgramCheck:
    """Plans every leg from `first` on, beginning at `start` [rad] or [m], or where the arm is; nothing moves.

    A leg of a repeat is planned anew until it begins where it began before. After a refusal the check goes on from the
    goal where that is given in joint values. `on_leg` gets every leg as it is planned. Raises `Lost` without a planner.
    """
    mistakes = find_mistakes(program, arm.description, points, programs)
    if mistakes:
        return ProgramCheck(program.name, mistakes, ())
    search = _Check(arm, points, start if start is not None else arm.joints, on_leg)
    search.plan_all(legs_of(program, programs, first))
    return ProgramCheck(program.name, (), tuple(search.legs.values()), search.left_out)


class _Check:
    """The legs of one check, each under what makes it different from the others."""

    def __init__(self, arm: Arm, points: Mapping[str, Point], start: Mapping[str, float], on_leg: object) -> None:
        self._arm, self._points, self._on_leg = arm, points, on_leg
        self.legs: dict[object, CheckedLeg] = {}
        self._ends: dict[object, Mapping[str, float] | None] = {}
        self.left_out: Reason | None = None
        self._joints: Mapping[str, float] = dict(start)
        self._scene_note: Reason | None = None

    def plan_all(self, legs: Iterator[Leg]) -> None:
        """Until the end, or until it is not known where the arm would be."""
        held: Leg | None = None
        for count, leg in enumerate(legs):
            if count >= MOST_CARRIED_OUT or len(self.legs) >= MOST_LEGS:
                self.left_out = because("program.check.only_first", count=count, step=path_text(leg.path))
                return
            if held is not None and not self._plan(held, leg):
                return
            held = leg
        if held is not None:
            self._plan(held, None)

    def _plan(self, leg: Leg, following: Leg | None) -> bool:
        """False where nobody can say where the arm is after it."""
        key = (leg.paths, leg.speed, tuple(round(value / SAME) for value in self._joints.values()))
        if key in self.legs:
            self.legs[key] = replace(self.legs[key], times=self.legs[key].times + 1)
        else:
            found, self._ends[key] = self._checked(leg, following)
            self.legs[key] = found
            if callable(self._on_leg):
                self._on_leg(found)
        end = self._ends[key]
        if end is None:
            self.left_out = because("program.check.end_unknown", step=path_text(leg.path))
            return False
        self._joints = end
        return True

    def _checked(self, leg: Leg, following: Leg | None) -> tuple[CheckedLeg, Mapping[str, float] | None]:
        """The leg, and the joint values after it."""
        step, text = leg.steps[-1], "; ".join(words_of(step) for step in leg.steps)
        made = CheckedLeg(leg.paths, leg.rounds, text, notes=self._notes(leg, following))
        if not leg.is_motion:
            if isinstance(step, Pick):
                return self._picked(step, made), None
            if isinstance(step, Play):
                return self._played(step, made)
            if isinstance(step, Attach | Detach | Grip):
                self._scene_note = because("program.check.scene_as_now", step=path_text(leg.path), text=text)
            return replace(made, duration=step.time if isinstance(step, Wait) else 0.0), self._joints
        try:
            plan = plan_leg(self._arm, leg, self._points, self._joints)
        except Refused as refusal:
            return replace(made, refusal=refusal), self._goal_of(step)
        margins = {name: 1.0 - margin.share for name, margin in plan.margins.items()}
        done = replace(
            made,
            duration=plan.duration,
            margins=margins,
            planner=plan.planner,
            planning_time=plan.planning_time,
        )
        return done, plan.end

    def _played(self, step: Play, made: CheckedLeg) -> tuple[CheckedLeg, Mapping[str, float] | None]:
        """The way to where a demonstration begins is planned, and the demonstration held against the scene."""
        try:
            shown = demonstrations_of(self._arm).require(step.demonstration)
            require_same_arm(self._arm, shown)
            require_free(self._arm, shown)
            way = self._arm.plan(joints=shown.start, from_joints=self._joints)
        except (Refused, BadArgument, ProgramError) as error:
            if not isinstance(error, Refused):
                error = Refused(str(error), check="demonstration", subject=step.demonstration, reason=error.reason)
            return replace(made, refusal=error), None
        return replace(made, duration=way.duration + shown.duration / step.share), shown.end

    def _picked(self, step: Pick, made: CheckedLeg) -> CheckedLeg:
        """A pick is planned when its thing is seen; whether the cell has thing and place is known now."""
        try:
            self._arm.require_pickable(step.thing, step.place)
        except (Refused, BadArgument) as error:
            if not isinstance(error, Refused):
                error = Refused(str(error), check="cell", subject=step.thing, reason=error.reason)
            return replace(made, refusal=error)
        return replace(made, notes=(*made.notes, because("program.check.planned_when_seen")))

    def _notes(self, leg: Leg, following: Leg | None) -> tuple[Reason, ...]:
        notes = list(lost_blend((leg, following)).values()) if following is not None else []
        if isinstance(leg.steps[-1], WaitFor):
            notes.append(because("program.check.wait_unknown"))
        if leg.is_motion and self._scene_note is not None:
            notes.append(self._scene_note)
        return tuple(notes)

    def _goal_of(self, step: object) -> Mapping[str, float] | None:
        """Where a refused motion would have ended, if its goal is given in joint values."""
        if not isinstance(step, MotionStep):
            return None
        if step.point in self._points:
            return self._points[step.point].joints
        if step.state:
            return {**self._joints, **self._arm.states[step.state]}
        return {**self._joints, **step.joints} if step.joints else None
