"""One goal being carried out: its bounds, its progress, its end."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import NamedTuple

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryResult,
    TrajectoryPoint,
)
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.services.stepper_gateway.goals.goal_validator import MotionStart, ValidatedGoal
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.motion.stream import Stream


class GoalEnding(NamedTuple):
    """How a goal is to end once the arm is at rest."""

    status: GoalStatusCode
    code: FollowErrorCode
    reason: Reason | None = None  # None: it has succeeded


@dataclass
class ActiveGoal:
    """A goal from its acceptance on; `stream` is None until its first knot may be sent."""

    goal_id: str
    goal: ValidatedGoal
    joints: tuple[Joint, ...]
    accepted: Moment
    accepted_from: MotionStart | None = None  # where the arm was then, if the goal was to start at once
    stream: Stream | None = None
    start_us: int = 0  # stream time at which it begins
    duration_us: int = 0
    first_seq: int = 0  # of the first chunk that carries its knots
    deadline: float | None = None  # [s] monotonic
    ending: GoalEnding | None = None  # set: the arm is decelerating
    is_executing: bool = False
    max_error: list[float] = field(default_factory=list)  # [steps]
    feedback_due: float = 0.0  # [s] monotonic
    commanded: tuple[float, ...] = ()  # [steps] latest
    is_passed: bool = False  # the arm has gone on from its end to that of the goal after it, without a stop
    departed: tuple[int, ...] = ()  # [steps] where the joints stood or passed when it began

    def __post_init__(self) -> None:
        self.max_error = [0.0] * len(self.joints)

    @property
    def target_steps(self) -> tuple[float, ...]:
        """[steps] where the goal ends, with their fraction."""
        return tuple(j.steps.to_steps(p) for j, p in zip(self.joints, self.goal.target, strict=True))

    def begin(self, stream: Stream, start_us: int, duration_us: int, deadline: float | None) -> None:
        """Its first knot comes `start_us` [us] along `stream`; it is late after `deadline` [s] monotonic."""
        self.stream, self.start_us, self.duration_us, self.deadline = stream, start_us, duration_us, deadline

    @property
    def end_us(self) -> int:
        """Stream time at which it ends."""
        return self.start_us + self.duration_us

    def follow(self, point: PathPoint, state: StateFrame) -> GoalEnding | None:
        """Take a state and the path [steps] at its instant; an ending if the arm has strayed from the path."""
        self.commanded = point.steps
        if state.play_us < self.start_us:
            return None
        for index, joint in enumerate(self.joints):
            error = point.steps[index] - state.steps[index]
            self.max_error[index] = max(self.max_error[index], abs(error))
            bound = self.goal.path_tolerance.position[index]
            if bound is not None and abs(error) > bound:
                return GoalEnding(
                    GoalStatusCode.ABORTED,
                    FollowErrorCode.PATH_TOLERANCE_VIOLATED,
                    because("ending.off_path", joint=joint.name, error=error, time=self.elapsed(state), bound=bound),
                )
        return self._too_fast_or_slow(point, state)

    def _too_fast_or_slow(self, point: PathPoint, state: StateFrame) -> GoalEnding | None:
        """An ending if a joint's velocity has left the path tolerance."""
        scale = state.time_scale
        rows = zip(self.joints, point.rate, state.velocity, self.goal.path_tolerance.velocity, strict=True)
        for joint, wanted, done, bound in rows:
            error = wanted * scale - done
            if bound is not None and abs(error) > bound:
                per_unit = joint.steps.per_unit
                off: dict[str, Value] = {"error": error / per_unit, "bound": bound / per_unit, "unit": joint.unit}
                return GoalEnding(
                    GoalStatusCode.ABORTED,
                    FollowErrorCode.PATH_TOLERANCE_VIOLATED,
                    because("ending.off_velocity", joint=joint.name, time=self.elapsed(state), **off),
                )
        return None

    def account(self, ending: GoalEnding, state: StateFrame | None, now: float) -> str:
        """A sentence for the log at `now` [s] monotonic: what moved where, how long, with what error, why it ended."""
        said = f"goal {self.goal_id} {ending.status.name.lower()} after {now - self.accepted.monotonic:.2f} s"
        if ending.reason is not None:
            said += f": {ending.reason}"
        if state is None or len(self.departed) != len(state.steps):
            return f"{said}; nothing moved for it"
        rows = list(zip(self.joints, self.departed, state.steps, strict=True))
        moves = ", ".join(
            f"{j.name} from {j.steps.to_position(old):+.4f} to {j.steps.to_position(new):+.4f} {j.unit}"
            for j, old, new in rows
        )
        errors = [abs(error) for error in self._final_errors(state)]
        off = max(errors)
        return f"{said}; {moves}; {off:.2f} steps from the goal at most ({self.joints[errors.index(off)].name})"

    def goal_errors(self, state: StateFrame) -> list[float]:
        """[steps] goal minus executed."""
        return [wanted - done for wanted, done in zip(self.target_steps, state.steps, strict=True)]

    def passing_error(self, point: PathPoint, state: StateFrame) -> GoalEnding | None:
        """The arm goes on past its end: an ending if it was not on its path there, to the goal tolerance."""
        bounds = self.goal.goal_tolerance.position
        for joint, wanted, done, bound in zip(self.joints, point.steps, state.steps, bounds, strict=True):
            if bound is not None and abs(wanted - done) > bound:
                return GoalEnding(
                    GoalStatusCode.ABORTED,
                    FollowErrorCode.GOAL_TOLERANCE_VIOLATED,
                    because("ending.off_path.passing", joint=joint.name, error=wanted - done, bound=bound),
                )
        return None

    def _final_errors(self, state: StateFrame) -> list[float]:
        """[steps] goal minus executed, or commanded minus executed where the arm has gone on."""
        if not self.is_passed:
            return self.goal_errors(state)
        return [wanted - done for wanted, done in zip(self.commanded, state.steps, strict=True)]

    def is_reached(self, state: StateFrame) -> bool:
        """True if the executed steps and the velocities are within the goal tolerance."""
        tolerance = self.goal.goal_tolerance
        places = zip(self.goal_errors(state), tolerance.position, strict=True)
        speeds = zip(state.velocity, tolerance.velocity, strict=True)
        return all(bound is None or abs(error) <= bound for error, bound in (*places, *speeds))

    def late(self, state: StateFrame, now: float) -> GoalEnding:
        """The ending for a goal that was not reached by `now` [s] monotonic."""
        errors = self.goal_errors(state)
        bounds = [math.inf if bound is None else bound for bound in self.goal.goal_tolerance.position]
        index = max(range(len(errors)), key=lambda i: abs(errors[i]) - bounds[i])
        joint, error = self.joints[index], errors[index]
        return GoalEnding(
            GoalStatusCode.ABORTED,
            FollowErrorCode.GOAL_TOLERANCE_VIOLATED,
            because(
                "ending.not_reached",
                joint=joint.name,
                error=error,
                distance=error / joint.steps.per_unit,
                unit=joint.unit,
                time=now - self.accepted.monotonic,
                bound=bounds[index],
                played=self.elapsed(state),
            ),
        )

    def elapsed(self, state: StateFrame) -> float:
        """[s] along the goal's own trajectory."""
        return min(max(0, state.play_us - self.start_us), self.duration_us) * 1e-6

    def feedback(self, point: PathPoint, state: StateFrame, positions: tuple[Vector, Vector], stamp: int) -> (
        FollowJointTrajectoryFeedback
    ):  # fmt: skip
        """`positions`: commanded and executed [rad] or [m]."""
        elapsed = self.elapsed(state)
        points = self.goal.trajectory.points
        scale = state.time_scale
        wanted = tuple(r * scale / j.steps.per_unit for j, r in zip(self.joints, point.rate, strict=True))
        done = tuple(r / j.steps.per_unit for j, r in zip(self.joints, state.velocity, strict=True))
        desired = TrajectoryPoint(positions=positions[0], velocities=wanted, time_from_start=elapsed)
        actual = TrajectoryPoint(positions=positions[1], velocities=done, time_from_start=elapsed)
        error = TrajectoryPoint(
            positions=tuple(a - b for a, b in zip(*positions, strict=True)),
            velocities=tuple(a - b for a, b in zip(wanted, done, strict=True)),
            time_from_start=elapsed,
        )
        return FollowJointTrajectoryFeedback(
            stamp=stamp,
            joint_names=tuple(joint.name for joint in self.joints),
            desired=desired,
            actual=actual,
            error=error,
            index=min(bisect_right(points, elapsed, key=lambda each: each.time_from_start), len(points) - 1),
            points=len(points),
            elapsed=elapsed,
            duration=self.duration_us * 1e-6,
        )

    def result(self, ending: GoalEnding, state: StateFrame | None, now: float) -> FollowJointTrajectoryResult:
        """What the client gets at `now` [s]; without a state the steps stay empty."""
        return FollowJointTrajectoryResult(
            error_code=ending.code,
            error_string=str(ending.reason or ""),
            joint_names=tuple(joint.name for joint in self.joints),
            commanded_steps=tuple(math.floor(steps + 0.5) for steps in self.commanded),  # as the device rounds
            executed_steps=state.steps if state is not None else (),
            max_following_error=tuple(self.max_error),
            final_error=tuple(self._final_errors(state)) if state is not None else (),
            duration=now - self.accepted.monotonic,
            why=ending.reason,
        )
