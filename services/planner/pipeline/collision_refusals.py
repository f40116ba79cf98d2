"""Refusals of what touches: which two, where, and what a person can do."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import Goal, JointGoal, NamedGoal, PlanCode, PoseGoal, WaypointGoal
from gemelo.schemas.reasons import Remedy, remedy
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import ROUNDING, first_collision, last_free, usable_clearance
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.pipeline.nearest_free import jog_out, nearest_free
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import PlanRefused, in_collision

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
DECIMALS = 5  # of [m] to which a distance is told: coal's last ones depend on what it was asked before
GRACE = 0.03  # of the time allowed, for the refusal of a plan that has used it up
LOOKS = 33  # at distances on a straight path that is refused, for the clearance that would do


class CollisionRefusals:
    """Says of one arm, in the world of the plan at hand, what is in the way."""

    def __init__(self, arm: ArmDescription, goals: Goals, checker: CollisionChecker) -> None:
        self._arm, self._goals, self._checker = arm, goals, checker

    def goal(
        self, asked: Goal, goal: Start, start: Start, deadline: Deadline, standing: Start | None = None
    ) -> PlanRefused:
        """The refusal of the configuration `goal` (n,) [rad] or [m] at which links touch, with the last free one on the
        straight line from `start` (n,), in the form of the goal `asked`.

        `standing` as in `Goals.candidates`.
        """
        deadline = deadline.extended(GRACE)
        last = last_free(self._checker, np.array(start), np.array(goal), deadline)
        values = dict(zip(self._arm.joint_names, (round(value, 4) for value in last.tolist()), strict=True))
        match asked:
            case PoseGoal():
                nearest = self._goals.shown_point(asked, standing or start, last, deadline)
            case JointGoal():
                nearest = tuple(values[name] for name in asked.name)
            case NamedGoal() | WaypointGoal():
                nearest = tuple(values.values())
        at_goal, margin = np.array(goal), self._checker.clearance
        would_do = [remedy("farthest_on_line", joints=values, units=self._units)]
        would_do += self._smaller(self._checker.world.distance(at_goal), margin)
        return self.refusal(PlanCode.GOAL_IN_COLLISION, "plan.collision.goal", at_goal, margin, nearest, would_do)

    def start(self, start: Start, deadline: Deadline) -> PlanRefused:
        """The refusal of `start` (n,) [rad] or [m], in which something touches, with the nearest configuration that
        touches nothing."""
        would_do, nearest = self._remedies(start), None
        with suppress(PlanRefused):  # what has not been found in time is not told
            nearest = nearest_free(self._arm, self._checker, start, deadline)
        if nearest is not None and nearest.can_be_jogged:
            would_do = [jog_out(self._arm, self._checker.reach, start, nearest.configuration), *would_do]
        elif nearest is not None:
            joints = dict(zip(self._arm.joint_names, nearest.configuration, strict=True))
            would_do = [remedy("free_at", joints=joints, units=self._units), *would_do]
        where, shown = "plan.collision.start", () if nearest is None else nearest.configuration
        refused = self.refusal(PlanCode.START_STATE_IN_COLLISION, where, np.array(start), 0.0, (), would_do)
        return PlanRefused(refused.code, msgspec.structs.replace(refused.refusal, nearest_free=shown))

    def line(self, start: Start, goal: Start, margin: float, deadline: Deadline, known: Array) -> PlanRefused:
        """The refusal of the straight joint path from `start` to `goal`, (n,) [rad] or [m], that does not keep `margin`
        [m], with the first configuration that touches; with the one that is `known`, where the time does not do."""
        rows, deadline = np.array((start, goal)), deadline.extended(GRACE)
        found = first_collision(self._checker, rows, margin, deadline)
        touching = known if found is None else found
        named = self._arm.state_names
        would_do = [remedy("via_named", names=tuple(named)) if named else remedy("via_another")]
        would_do += self._smaller(self._least_on(rows, deadline), margin)
        return self.refusal(PlanCode.PLANNING_FAILED, "plan.collision.line", touching, margin, (), would_do)

    def path(self, touching: Array, margin: float) -> PlanRefused:
        """The refusal of found paths that do not keep `margin` [m] once they are timed; `touching` (n,) [rad] or [m] is
        on one."""
        would_do = remedy("other_seed"), remedy("report")
        return self.refusal(PlanCode.PLANNING_FAILED, "plan.collision.path", touching, margin, (), would_do)

    def waypoints(self, touching: Array, margin: float) -> PlanRefused:
        """The refusal of the straight lines from waypoint to waypoint, on which `touching` (n,) [rad] or [m] does not
        keep `margin` [m]."""
        would_do = remedy("waypoints_around"), remedy("free_motion")
        return self.refusal(PlanCode.PLANNING_FAILED, "plan.collision.waypoints", touching, margin, (), would_do)

    def refusal(
        self,
        code: PlanCode,
        where: str,
        configuration: Array,
        margin: float,
        nearest: Vector,
        would_do: Iterable[Remedy],
    ) -> PlanRefused:
        """The refusal, by the reason `where`, of `configuration` (n,) [rad] or [m], which does not keep `margin` [m] in
        the plan's world, with the names of both; `nearest` is in the goal's own form."""
        world = self._checker.world
        contacts = world.contacts(configuration, margin + ROUNDING)
        pairs = [(contact.first, contact.second) for contact in contacts] or [("?", "?")]
        near = round(contacts[0].distance, DECIMALS) if contacts else None
        standing = tuple(configuration.tolist())
        return in_collision(code, where, pairs, margin, nearest, would_do, standing, world.objects, near)

    def _least_on(self, rows: Array, deadline: Deadline) -> float:
        """The least distance [m] at `LOOKS` places on a straight path (2, n); 0 where the time does not do for them."""
        least = math.inf
        for share in np.linspace(0.0, 1.0, LOOKS).tolist():
            if least <= 0.0 or deadline.has_passed():
                return 0.0
            configuration = rows[0] + share * (rows[1] - rows[0])
            if self._checker.least_distance(configuration) < least:
                least = min(least, self._checker.distance(configuration))
        return least

    def _smaller(self, distance: float, margin: float) -> list[Remedy]:
        """The clearance that would do for things `distance` [m] apart; none if none would."""
        usable = usable_clearance(distance, margin)
        return [] if usable is None else [remedy("smaller_clearance", clearance=usable)]

    @property
    def _units(self) -> tuple[str, ...]:
        return tuple(joint.unit for joint in self._arm.joints)

    def _remedies(self, start: Start) -> list[Remedy]:
        """What a person can do for an arm that touches something, besides moving it."""
        world = self._checker.world
        objects = world.objects.keys() - set(JAWS)  # which are the gripper's, and stay
        touched = [name for pair in world.pairs_within(start) for name in pair if name in objects]
        carried = [shown.name for shown in world.scene.objects if shown.attached and shown.name in touched]
        if carried:
            return [remedy("touch_links", object=carried[0]), remedy("let_go", object=carried[0])]
        if touched:
            return [remedy("remove_object", object=touched[0]), remedy("allow_pair"), remedy("free_by_hand")]
        return [remedy("free_by_hand"), remedy("check_reference")]
