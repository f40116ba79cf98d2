"""Refusals of what touches: which two, where, and what a person can do."""

from __future__ import annotations

import math
from contextlib import suppress

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import Goal, JointGoal, NamedGoal, PlanCode, PoseGoal, WaypointGoal
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import ROUNDING, first_collision, last_free, usable_clearance
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.pipeline.nearest_free import jog_words, nearest_free
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
        remedy = f"the farthest it can go on the straight path there: {self._named(tuple(values.values()))}"
        at_goal, margin = np.array(goal), self._checker.clearance
        remedy += self._smaller(self._checker.world.distance(at_goal), margin)
        return self.refusal(PlanCode.GOAL_IN_COLLISION, "at the goal", at_goal, margin, nearest, remedy)

    def start(self, start: Start, deadline: Deadline) -> PlanRefused:
        """The refusal of `start` (n,) [rad] or [m], in which something touches, with the nearest configuration that
        touches nothing."""
        remedy, nearest = self._remedy(start), None
        with suppress(PlanRefused):  # what has not been found in time is not told
            nearest = nearest_free(self._arm, self._checker, start, deadline)
        if nearest is not None and nearest.can_be_jogged:
            words = jog_words(self._arm, self._checker.reach, start, nearest.configuration)
            remedy = f"`{words}` leads out; or {remedy}"
        elif nearest is not None:
            remedy = f"nothing touches at {self._named(nearest.configuration)}; {remedy}"
        where, shown = "where the arm stands", () if nearest is None else nearest.configuration
        refused = self.refusal(PlanCode.START_STATE_IN_COLLISION, where, np.array(start), 0.0, (), remedy)
        return PlanRefused(refused.code, msgspec.structs.replace(refused.refusal, nearest_free=shown))

    def line(self, start: Start, goal: Start, margin: float, deadline: Deadline, known: Array) -> PlanRefused:
        """The refusal of the straight joint path from `start` to `goal`, (n,) [rad] or [m], that does not keep `margin`
        [m], with the first configuration that touches; with the one that is `known`, where the time does not do."""
        rows, deadline = np.array((start, goal)), deadline.extended(GRACE)
        found = first_collision(self._checker, rows, margin, deadline)
        touching = known if found is None else found
        named = ", ".join(self._arm.state_names)
        remedy = f"go via another configuration, for example a named one ({named})"
        remedy += self._smaller(self._least_on(rows, deadline), margin)
        return self.refusal(PlanCode.PLANNING_FAILED, "on the straight path to the goal", touching, margin, (), remedy)

    def path(self, touching: Array, margin: float) -> PlanRefused:
        """The refusal of found paths that do not keep `margin` [m] once they are timed; `touching` (n,) [rad] or [m] is
        on one."""
        remedy = "ask with another seed or planner_id; if it stays, report this as a defect"
        return self.refusal(PlanCode.PLANNING_FAILED, "on the path that was found", touching, margin, (), remedy)

    def waypoints(self, touching: Array, margin: float) -> PlanRefused:
        """The refusal of the straight lines from waypoint to waypoint, on which `touching` (n,) [rad] or [m] does not
        keep `margin` [m]."""
        remedy = "give waypoints that lead around it, or ask for a free motion"
        return self.refusal(PlanCode.PLANNING_FAILED, "on the path through the waypoints", touching, margin, (), remedy)

    def refusal(
        self, code: PlanCode, where: str, configuration: Array, margin: float, nearest: Vector, remedy: str
    ) -> PlanRefused:
        """The refusal of `configuration` (n,) [rad] or [m], which does not keep `margin` [m] in the plan's world, with
        the names of both; `nearest` is in the goal's own form."""
        world = self._checker.world
        contacts = world.contacts(configuration, margin + ROUNDING)
        pairs = [(contact.first, contact.second) for contact in contacts] or [("?", "?")]
        near = round(contacts[0].distance, DECIMALS) if contacts else None
        standing = tuple(configuration.tolist())
        return in_collision(code, where, pairs, margin, nearest, remedy, standing, world.objects, near)

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

    def _smaller(self, distance: float, margin: float) -> str:
        """The clearance that would do for things `distance` [m] apart, for the end of a remedy; empty if none would."""
        usable = usable_clearance(distance, margin)
        return "" if usable is None else f"; or ask for a clearance of {1000.0 * usable:g} mm, which would do"

    def _named(self, configuration: Start) -> str:
        pairs = zip(self._arm.joints, configuration, strict=True)
        return ", ".join(f"{joint.name} {value:g} {joint.unit}" for joint, value in pairs)

    def _remedy(self, start: Start) -> str:
        """What a person can do for an arm that touches something, besides moving it."""
        world = self._checker.world
        touched = [name for pair in world.pairs_within(start) for name in pair if name in world.objects]
        carried = [shown.name for shown in world.scene.objects if shown.attached and shown.name in touched]
        if carried:
            return f"name the links that {carried[0]} may touch (`gemelo scene attach --touch`), or let it go"
        if touched:
            return (
                f"move or remove {touched[0]} (`gemelo scene remove {touched[0]}`), allow the pair, or move the arm "
                "free by hand, then `gemelo reference`"
            )
        return "move the arm free by hand, then `gemelo reference`; or check the reference: the arm may be elsewhere"
