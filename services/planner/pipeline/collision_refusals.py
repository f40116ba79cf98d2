"""Refusals of what touches: which two, where, and what a person can do."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from schemas.message import Vector
from schemas.planning import Goal, JointGoal, NamedGoal, PlanCode, PoseGoal, WaypointGoal
from services.arm.description import Arm
from services.planner.collision.checker import CollisionChecker
from services.planner.collision.clearance import CLEARANCE, ROUNDING, first_collision, last_free
from services.planner.kinematics.goals import Goals
from services.planner.path.path import Start
from services.planner.pipeline.nearest_free import jog_words, way_out
from services.planner.request.deadline import Deadline
from services.planner.request.refusals import NoPlan, in_collision

Array = NDArray[np.float64]


class Blockade:
    """Says of one arm, in the world of the plan at hand, what is in the way."""

    def __init__(self, arm: Arm, goals: Goals, surroundings: CollisionChecker) -> None:
        self._arm, self._goals, self._surroundings = arm, goals, surroundings

    def goal(self, asked: Goal, goal: Start, start: Start, deadline: Deadline, standing: Start | None = None) -> NoPlan:
        """The refusal of a goal at which links touch, with the last free posture on the way, in the goal's own form.

        `standing` as in `Goals.candidates`.
        """
        last = last_free(self._surroundings, np.array(start), np.array(goal))
        values = dict(zip(self._arm.joint_names, (round(value, 4) for value in last.tolist()), strict=True))
        match asked:
            case PoseGoal():
                nearest = self._goals.shown_point(asked, standing or start, last, deadline)
            case JointGoal():
                nearest = tuple(values[name] for name in asked.name)
            case NamedGoal() | WaypointGoal():
                nearest = tuple(values.values())
        remedy = f"the farthest it can go on the straight way there: {self._named(tuple(values.values()))}"
        return self.refusal(PlanCode.GOAL_IN_COLLISION, "at the goal", np.array(goal), CLEARANCE, nearest, remedy)

    def start(self, start: Start, deadline: Deadline) -> NoPlan:
        """The refusal of a start in which something touches, with the nearest posture that touches nothing."""
        remedy, nearest = self._remedy(start), way_out(self._arm, self._surroundings, start, deadline)
        if nearest is not None and nearest.can_be_jogged:
            remedy = (
                f"`{jog_words(self._arm, self._surroundings.reach, start, nearest.posture)}` leads out; or {remedy}"
            )
        elif nearest is not None:
            remedy = f"nothing touches at {self._named(nearest.posture)}; {remedy}"
        where, shown = "where the arm stands", () if nearest is None else nearest.posture
        no_plan = self.refusal(PlanCode.START_STATE_IN_COLLISION, where, np.array(start), 0.0, (), remedy)
        return NoPlan(no_plan.code, msgspec.structs.replace(no_plan.refusal, way_out=shown))

    def line(self, start: Start, goal: Start, margin: float) -> NoPlan:
        """The refusal of a straight line on which something touches, where it does so first."""
        found = first_collision(self._surroundings, np.array((start, goal)), margin)
        touching = np.array(goal) if found is None else found
        named = ", ".join(self._arm.state_names)
        remedy = f"go by way of another posture, for example a named one ({named})"
        return self.refusal(PlanCode.PLANNING_FAILED, "on the straight way to the goal", touching, margin, (), remedy)

    def way(self, touching: Array, margin: float) -> NoPlan:
        """The refusal of the ways that were found and came too near to something once they had their time."""
        remedy = "ask with another seed or planner_id; if it stays, report this as a defect"
        return self.refusal(PlanCode.PLANNING_FAILED, "on the way that was found", touching, margin, (), remedy)

    def by(self, touching: Array, margin: float) -> NoPlan:
        """The refusal of the straight lines from waypoint to waypoint."""
        remedy = "give waypoints that lead around it, or ask for a free motion"
        return self.refusal(PlanCode.PLANNING_FAILED, "on the way by the waypoints", touching, margin, (), remedy)

    def refusal(
        self, code: PlanCode, where: str, posture: Array, margin: float, nearest: Vector, remedy: str
    ) -> NoPlan:
        """The refusal of a posture in which the plan's world touches the arm, with the names of both."""
        world = self._surroundings.world
        pairs = world.pairs_within(posture, margin + ROUNDING) or [("?", "?")]
        standing = tuple(posture.tolist())
        return in_collision(code, where, pairs, margin, nearest, remedy, standing, world.objects)

    def _named(self, posture: Start) -> str:
        pairs = zip(self._arm.joints, posture, strict=True)
        return ", ".join(f"{joint.name} {value:g} {joint.unit}" for joint, value in pairs)

    def _remedy(self, start: Start) -> str:
        """What a person can do for an arm that touches something, besides moving it."""
        world = self._surroundings.world
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
