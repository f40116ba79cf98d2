"""The answers to `ik`, `fk` and `state_validity`, each with the reason where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import msgspec
import numpy as np

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    FkRequest,
    FkResponse,
    IkRequest,
    IkResponse,
    IkSolution,
    PlanCode,
    ValidityRequest,
    ValidityResponse,
)
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import Contact
from gemelo.services.planner.collision.clearance import DistanceChecker, last_free
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.goals import INVALID, Goals, Start
from gemelo.services.planner.kinematics.pose_goals import FARTHEST
from gemelo.services.planner.request.deadline import NEVER, Deadline
from gemelo.services.planner.request.refusals import (
    PlanRefused,
    beyond_limit,
    in_collision,
    malformed,
    objects_in,
    unknown_name,
)
from gemelo.services.planner.request.start_state import require_parallel, resolve_start

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_SOLUTIONS = 64  # chosen: more than any arm has that is not redundant, and small as a message
LOOKED_THROUGH = 256  # configurations, of which all may touch something; chosen: bounds the time of the answer


class KinematicRequests:
    """Answers for one arm; `present` is its newest joint state and `age` [s] how old that is."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics | None = None) -> None:
        self._arm = arm
        self._kinematics = kinematics or Kinematics(arm)
        self._goals = Goals(arm, self._kinematics)

    def ik(
        self,
        request: IkRequest,
        present: JointState | None,
        age: float = 0.0,
        checker: DistanceChecker | None = None,
        deadline: Deadline = NEVER,
    ) -> IkResponse:
        """The configurations [rad] or [m] for a pose, the nearest to `request.near` or the present state first, or the
        refusal; `age` [s] is of `present`. With `avoid_collisions`, `checker` says which of them touch something."""
        try:
            _require_count(request.solutions)
            near = self._standing(request.near, present, age)
            configurations = list(islice(self._goals.candidates(request.goal, near, deadline), LOOKED_THROUGH))
            if request.avoid_collisions:
                configurations = self._free(configurations, checker or self._kinematics.collisions)
        except PlanRefused as refused:
            return IkResponse(code=refused.code, refusal=refused.refusal)
        solutions = (
            IkSolution(position=configuration, distance=self._goals.travel(near, configuration))
            for configuration in configurations
        )
        nearest_first = sorted(solutions, key=lambda solution: solution.distance)[: request.solutions]
        return IkResponse(code=PlanCode.SUCCESS, name=self._arm.joint_names, solutions=tuple(nearest_first))

    def fk(self, request: FkRequest, present: JointState | None, age: float = 0.0) -> FkResponse:
        """The poses of the requested links in the base frame, or the refusal; `age` [s] is of `present`. The limits of
        joints that the request names are not checked."""
        try:
            positions = self._completed(request, present, age)
            poses = self._kinematics.link_poses(positions)
            links = request.links or (self._arm.tool_frame,)
            for link in links:
                if link not in poses:
                    raise unknown_name(PlanCode.FRAME_TRANSFORM_FAILURE, "unknown link", link, poses, self._arm.name)
        except PlanRefused as refused:
            return FkResponse(code=refused.code, refusal=refused.refusal)
        return FkResponse(code=PlanCode.SUCCESS, links=links, poses=tuple(poses[link] for link in links))

    def validity(
        self, request: ValidityRequest, present: JointState | None, age: float, world: World
    ) -> ValidityResponse:
        """Whether the arm may stand in the configuration, within its limits and clear of itself and of `world`; `age`
        [s] is of `present`. A refusal names the nearest one on the straight joint path from `present`."""
        try:
            asked = self._completed(FkRequest(name=request.name, position=request.position), present, age)
            asked = self._within_limits(request, asked)
        except PlanRefused as refused:
            return ValidityResponse(code=refused.code, refusal=refused.refusal)
        contacts = tuple(world.contacts(asked, world.clearance))
        if not contacts:
            return ValidityResponse(code=PlanCode.SUCCESS)
        touching = self._touching(asked, self._nearest_free(asked, present, age, world), contacts, world)
        return ValidityResponse(code=touching.code, refusal=touching.refusal, contacts=contacts)

    def _within_limits(self, request: ValidityRequest, asked: Start) -> Start:
        """`asked`, the named joints at a limit that only rounding misses; raises `PlanRefused` for one beyond it."""
        values = dict(zip(self._arm.joint_names, asked, strict=True))
        for joint in self._arm.joints:
            if joint.name not in request.name:
                continue
            if not joint.is_within(joint.rounded(values[joint.name])):
                within = tuple(self._arm.joint(name).clamp(values[name]) for name in request.name)
                raise beyond_limit(self._arm, joint, values[joint.name], within)
            values[joint.name] = joint.clamp(values[joint.name])
        return tuple(values[name] for name in self._arm.joint_names)

    def _nearest_free(self, asked: Start, present: JointState | None, age: float, world: World) -> Start:
        """The last free configuration on the straight joint path from `present`; empty where there is none."""
        try:
            standing = self._standing(None, present, age)
        except PlanRefused:
            return ()
        last = last_free(world, np.array(standing), np.array(asked))
        return tuple(last.tolist()) if world.distance(last) > world.clearance else ()

    def _touching(self, asked: Start, nearest: Start, contacts: Sequence[Contact], world: World) -> PlanRefused:
        pairs = [(contact.first, contact.second) for contact in contacts]
        would_do = remedy("nearest_free") if nearest else remedy("other_configuration")
        return in_collision(
            PlanCode.GOAL_IN_COLLISION,
            "plan.collision.there",
            pairs,
            world.clearance,
            nearest,
            (would_do,),
            asked,
            world.objects,
            contacts[0].distance,
        )

    def _free(self, configurations: list[Start], checker: DistanceChecker) -> list[Start]:
        """Those that touch nothing; raises `PlanRefused` where all do."""
        clearance = checker.clearance
        free = [configuration for configuration in configurations if checker.distance(configuration) > clearance]
        if free:
            return free
        where = "ik.collision.every" if len(configurations) > 1 else "ik.collision.only"
        would_do = remedy("other_pose"), remedy("touching_too")
        pairs, near = checker.pairs_within(configurations[0], clearance), checker.distance(configurations[0])
        objects = objects_in(pairs, self._arm.model.link_names)
        code = PlanCode.GOAL_IN_COLLISION
        raise in_collision(code, where, pairs, clearance, (), would_do, objects=objects, distance=near)

    def _standing(self, given: JointState | None, present: JointState | None, age: float) -> Start:
        """Where distances are measured from; that the arm moves does not matter."""
        return resolve_start(self._arm, _at_rest(given), _at_rest(present), age)

    def _completed(self, request: FkRequest, present: JointState | None, age: float) -> Start:
        """The named joints where they are said to be, beyond their limits too; the others where they are now."""
        require_parallel(request.name, request.position, "request")
        for name, value in zip(request.name, request.position, strict=True):
            if name not in self._arm.joint_names:
                raise unknown_name(INVALID, "unknown joint", name, self._arm.joint_names, self._arm.name)
            if abs(value) > FARTHEST:
                why = because("ik.position", remedy("rad_or_metres"), joint=name, value=value, most=FARTHEST)
                raise malformed(INVALID, name, why)
        given = dict(zip(request.name, request.position, strict=True))
        if len(given) == len(self._arm.joints):
            return tuple(given[name] for name in self._arm.joint_names)
        standing = self._standing(None, present, age)
        return tuple(given.get(name, value) for name, value in zip(self._arm.joint_names, standing, strict=True))


def _at_rest(state: JointState | None) -> JointState | None:
    return None if state is None else msgspec.structs.replace(state, velocity=())


def _require_count(count: int) -> None:
    if not 1 <= count <= MOST_SOLUTIONS:
        why = because("ik.solutions", remedy("ask_up_to", most=MOST_SOLUTIONS), count=count)
        raise malformed(INVALID, "solutions", why)
