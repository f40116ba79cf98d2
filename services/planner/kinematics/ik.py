"""Inverse kinematics: in closed form where the arm has one, else descents from many deterministic starts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, islice, pairwise

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.centring import Centring
from gemelo.services.planner.kinematics.closed_form import ClosedForm, chain_order, closed_form, completed, turns_about
from gemelo.services.planner.kinematics.descent import Attempt, Descent
from gemelo.services.planner.kinematics.joint_ranges import nearest_first, one_turn, spread
from gemelo.services.planner.kinematics.parallel_axes import ParallelAxes, parallel_axes
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import Deadline

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
STARTS = 24  # beside the present configuration; chosen: `ik_success` of the bench holds it
FULL_POSE_JOINTS, MORE_STARTS = 6, 64  # that many where a full pose has to be searched for
REFINED = 8  # of the closed form together, behind the first one, which mostly will do
BATCH = 4  # starts that are tried together before their solutions are handed out
FEW = 4  # starts where the closed form finds nothing, which it has never missed
FINE_TURNS, MOST_AT_LIMITS = (
    120,
    12,
)  # the same, where none of those has a configuration, and configurations that are tried then
LOOKS, NO_EFFECT = 5, 1e-9  # configurations in which a joint does not move the tool, by so much per rad or m
TURNS = 16  # rotations about the axis of a tool that only has to point somewhere
SAME = 1e-4  # [s] at full speed: solutions nearer than that are one
SAME_REDUNDANT = 0.1  # [s] the same, where solutions lie in a continuum; chosen: neighbours there are no other choice


class InverseKinematics:
    """Joint values for tool targets."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, is_numeric: bool = False) -> None:
        self._kinematics = kinematics
        self._descent = Descent(arm, kinematics)
        self._centring = Centring(arm, kinematics, self._descent)
        self._closed: ClosedForm | None = None if is_numeric else closed_form(arm, kinematics)
        self._parallel: ParallelAxes | None = None if is_numeric else parallel_axes(arm, kinematics)
        self._lower, self._upper = one_turn(arm)
        self._speeds = [joint.velocity for joint in arm.joints]
        self._speed = np.array(self._speeds)
        self._idle = self._without_effect(arm)
        # The first joint of the chain turns the whole arm as it is: its mirror image is no other configuration.
        turning = [index for index in chain_order(arm)[1:] if arm.joints[index].unit == "rad"]
        self._mirrored = [index for index in turning if not self._idle[index]]
        self._period = np.array([math.tau if math.isinf(joint.upper) else 0.0 for joint in arm.joints])
        self._is_limited = not self._period.any() and not self._idle.any()  # and each joint moves the tool
        self._starts = np.array(spread(arm, self._start_count(arm)))

    @property
    def is_closed_form(self) -> bool:
        """True if full poses are solved in closed form."""
        return self._closed is not None

    def solutions(self, target: ToolTarget, near: Array, deadline: Deadline) -> Iterator[Array]:
        """Distinct joint values (n,) [rad] or [m] that meet the target: all of the closed form, the nearest to `near`
        (n,) first; where that gives none, what `near` leads to and its mirror images, then batches, each nearest
        first."""
        found: list[list[float]] = []
        for positions in chain(self._closed_form_solutions(target, near), self._at_limits(target, near, found)):
            values = positions.tolist()
            if self._is_new(values, found, SAME):
                found.append(values)
                yield positions
        if not found:
            is_known = self._parallel is not None or (self._closed is not None and target.rotation is not None)
            starts = FEW if is_known and not target.is_tolerant else len(self._starts)
            yield from self._searched(target, near, deadline, starts)

    def nearest(self, target: ToolTarget, near: Array, deadline: Deadline) -> list[Array]:
        """Joint values (n,) [rad] or [m] that bring the tool as near to the target as their start allows, the best
        first; the starts are `near` (n,) and points spread over the limits."""
        attempts = [self.descend(target, near), *self._attempts(target, near, deadline)]
        return [attempt.positions for attempt in sorted(attempts, key=lambda attempt: attempt.error)]

    def travel(self, first: Array, second: Array) -> float:
        """[s] that the slowest joint takes from `first` to `second` (n,) at full speed: the distance that counts."""
        return float(np.max(np.abs(first - second) / self._speed))

    def descend(self, target: ToolTarget, start: Array) -> Attempt:
        """The nearest local optimum from `start` (n,) [rad] or [m]."""
        return self._descent.descend(target, start)

    def _closed_form_solutions(self, target: ToolTarget, near: Array) -> Iterator[Array]:
        """The closed form's configurations, each refined until it meets the target; lazily, the nearest first."""
        rows = self._closed_form_configurations(target, near)
        if not len(rows):
            return
        nearest = nearest_first(rows, near, self._speed)
        begins = [0, *range(1, len(nearest), REFINED)]
        for begin, end in pairwise([*begins, len(nearest)]):
            for attempt in self._descent.descend_all(target, nearest[begin:end]):
                if attempt.is_solution:
                    yield attempt.positions

    def _closed_form_configurations(self, target: ToolTarget, near: Array) -> Array:
        """(m, n) [rad] or [m], in no order."""
        if self._parallel is not None:
            return self._parallel.configurations(target.position, near)
        if self._closed is None:
            return near[None][:0]
        configurations = []
        for rotation in self._rotations(target, near):
            exact, guesses = self._closed.configurations(target.position, rotation, near)
            configurations.append(exact)
            for guess in guesses:
                configurations += [row[None] for row in self._from_guess(self._closed, target, guess, near)]
        if len(configurations) == 1:
            return configurations[0]
        return np.concatenate(configurations) if configurations else near[None][:0]

    def _at_limits(self, target: ToolTarget, near: Array, found: list[list[float]]) -> Iterator[Array]:
        """Where nothing was found, for the free turn leaves hardly any configuration within the limits: what those of a
        fine turn lead to that miss the limits least."""
        if found or self._closed is None or target.pointing is None:
            return
        closed, present = self._closed, self._kinematics.tool(near).rotation
        rotations = turns_about(target.pointing.direction, target.pointing.axis, present, FINE_TURNS)
        answers = [closed.branches(target.position, rotation) for rotation in rotations]
        exact = np.concatenate([branches[~is_guess] for branches, is_guess in answers])
        configurations, missed = closed.turns.nearly(exact[np.isfinite(exact).all(axis=1)])
        for place in np.argsort(missed)[:MOST_AT_LIMITS].tolist():
            attempt = self.descend(target, configurations[place])
            if attempt.is_solution:
                yield attempt.positions

    def _rotations(self, target: ToolTarget, near: Array) -> list[Array]:
        """The tool's rotations that the target asks for, or some of them where it leaves one turn free."""
        if target.rotation is not None:
            return [target.rotation]
        if target.pointing is None:
            return []
        present = self._kinematics.tool(near).rotation
        return turns_about(target.pointing.direction, target.pointing.axis, present, TURNS)

    def _from_guess(self, closed: ClosedForm, target: ToolTarget, guess: Array, near: Array) -> Iterator[Array]:
        """Where axes coincide, how two joints share one turn is free: as nearly as they can to how they stand now."""
        alike = completed(target, self._kinematics, guess)
        for turned in closed.turns.within_limits(np.array(alike), near) if alike else []:
            attempt = self.descend(target, self._centring.drawn(target, turned, near))
            if attempt.is_solution:
                yield attempt.positions

    def _as_near(self, positions: Array, near: Array) -> Array:
        """The same pose of the tool with joints without limits less than half a turn from `near` (n,) [rad] or [m], and
        those that do not move the tool, as of a gripper, as they are there."""
        if self._is_limited:
            return positions
        turns = np.rint((positions - near) / np.where(self._period > 0.0, self._period, 1.0))
        return np.where(self._idle, near, positions - turns * self._period)

    def _without_effect(self, arm: ArmDescription) -> NDArray[np.bool_]:
        """(n,) True for the joints that do not move the tool."""
        rows = [self._kinematics.jacobian(start) for start in spread(arm, LOOKS)]
        return np.asarray(np.abs(np.vstack(rows)).max(axis=0) < NO_EFFECT)

    def _start_count(self, arm: ArmDescription) -> int:
        return MORE_STARTS if len(arm.joints) >= FULL_POSE_JOINTS and self._closed is None else STARTS

    def _searched(self, target: ToolTarget, near: Array, deadline: Deadline, starts: int) -> Iterator[Array]:
        first = self._first(target, near)
        yield from first
        found = [positions.tolist() for positions in first]
        attempts = islice(self._attempts(target, near, deadline), starts)
        while batch := list(islice(attempts, BATCH)):
            new: list[Array] = []
            for attempt in batch:
                if attempt.is_solution:
                    self._collect(target, attempt.positions, near, found, new)
            yield from sorted(new, key=lambda positions: self.travel(near, positions))

    def _first(self, target: ToolTarget, near: Array) -> list[Array]:
        """What `near` leads to and, for an arm of few joints, its mirror image in each elbow; nearest first."""
        first = self.descend(target, near)
        if not first.is_solution:
            return []
        found = [self._as_near(first.positions, near)]
        known = [found[0].tolist()]
        idle = int(np.count_nonzero(self._idle))
        if len(near) - idle < FULL_POSE_JOINTS and not self._centring.is_redundant(target, first.positions, idle):
            for joint in self._mirrored:
                start = first.positions.copy()
                start[joint] = self._lower[joint] + self._upper[joint] - start[joint]
                attempt = self.descend(target, start)
                positions = self._as_near(attempt.positions, near)
                if attempt.is_solution and self._is_new(positions.tolist(), known, SAME):
                    found.append(positions)
                    known.append(positions.tolist())
        return sorted(found, key=lambda positions: self.travel(near, positions))

    def _collect(
        self, target: ToolTarget, positions: Array, near: Array, found: list[list[float]], new: list[Array]
    ) -> None:
        """Puts a solution that is none of those found into both lists; far from `near`, freedom goes to the middles."""
        centred = self._centring.centred(target, positions)
        is_redundant = centred is not None
        positions = self._as_near(positions if centred is None else centred, near)
        values = positions.tolist()
        if self._is_new(values, found, SAME_REDUNDANT if is_redundant else SAME):
            found.append(values)
            new.append(positions)

    def _is_new(self, values: list[float], found: list[list[float]], same: float) -> bool:
        speeds = self._speeds
        for other in found:  # without generators: most differ in the first joint already
            for a, b, speed in zip(other, values, speeds, strict=True):
                if abs(a - b) / speed > same:
                    break
            else:
                return False
        return True

    def _attempts(self, target: ToolTarget, near: Array, deadline: Deadline) -> Iterator[Attempt]:
        """Descents from starts spread over the limits, `BATCH` at once; the first ones lie around `near`."""
        starts = self._starts.copy()
        starts[:BATCH] = near + 0.25 * (starts[:BATCH] - 0.5 * (self._lower + self._upper))
        for begin in range(0, len(starts), BATCH):
            if deadline.has_passed():
                return
            yield from self._descent.descend_all(target, starts[begin : begin + BATCH])
