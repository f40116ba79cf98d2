"""Requests and scenes as hypothesis draws them."""

from __future__ import annotations

import msgspec
import numpy as np
from hypothesis import strategies as st

from gemelo.schemas.frames import Transform
from gemelo.schemas.planners import NAMES
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    Goal,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject, Shape, SphereShape
from gemelo.services.planner.core import Planner
from gemelo.services.planner.kinematics.task_space import task_space
from tests.planner.independent import Judge
from tests.planner.judging import asked, configuration_at, joints, quaternion_of

MOST_JOINTS = 7
Numbers = tuple[float, ...]


def even(count: int, low: float, high: float) -> st.SearchStrategy[Numbers]:
    """Numbers from anywhere between, where hypothesis alone would prefer round ones."""
    return st.integers(0, 2**32).map(lambda seed: tuple(np.random.default_rng(seed).uniform(low, high, count).tolist()))


SHARES = st.one_of(even(MOST_JOINTS, 0.0, 1.0), even(MOST_JOINTS, 0.0, 1.0), st.tuples(*[st.floats(0.0, 1.0)] * 7))
INNER = even(MOST_JOINTS, 0.1, 0.9)
WAYS = even(3, -1.0, 1.0).filter(lambda way: np.linalg.norm(way) > 0.1)
QUATERNIONS = even(4, -1.0, 1.0).filter(lambda q: np.linalg.norm(q) > 0.1)
SCALINGS = st.one_of(st.just(1.0), st.floats(0.05, 1.0))
SIZES = even(3, 0.01, 0.12)  # [m]
FREE = st.builds(FreeMotion, planner_id=st.sampled_from(("", *NAMES)), seed=st.integers(0, 2**31))
SHAPES = st.one_of(
    SIZES.map(lambda sizes: BoxShape(size=sizes)),
    SIZES.map(lambda sizes: SphereShape(radius=0.5 * sizes[0])),
    SIZES.map(lambda sizes: CylinderShape(radius=0.5 * sizes[0], length=4.0 * sizes[1])),
)


def unit(values: Numbers) -> Numbers:
    return tuple((np.array(values) / np.linalg.norm(values)).tolist())


@st.composite
def scenes(draw: st.DrawFn) -> PlanningScene:
    """A few things within the arm's reach, not on its column."""
    objects = []
    for index in range(draw(st.integers(0, 4))):
        angle, out, up = np.array((3.0, 0.225, 0.3)) * draw(even(3, -1.0, 1.0)) + (0.0, 0.375, 0.3)
        place = (out * float(np.cos(angle)), out * float(np.sin(angle)), float(up))
        pose = Transform(translation=place, rotation=unit(draw(QUATERNIONS)))
        padding = draw(st.sampled_from((0.0, 0.0, 0.01)))
        objects.append(SceneObject(name=f"thing {index}", shape=draw(SHAPES), pose=pose, padding=padding))
    return PlanningScene(version=draw(st.integers(1, 99)), objects=tuple(objects))


def held(planner: Planner, shape: Shape) -> SceneObject:
    """Something small that the tool carries, whatever it touches of the arm."""
    links = tuple(link.name for link in planner.arm.model.links)
    return SceneObject(name="held", shape=shape, frame=planner.arm.tool_frame, attached=True, touch_links=links)


@st.composite
def pose_goals(draw: st.DrawFn, planner: Planner, start: Numbers) -> PoseGoal:
    """A pose that some configuration has, in every form that this arm can fulfil."""
    judge, is_full = Judge(planner.arm), task_space(planner.arm, planner.kinematics).is_full
    position, rotation = judge.tool(np.array(configuration_at(planner, draw(INNER))))
    frame = draw(st.sampled_from(("", planner.arm.base_frame, planner.arm.model.links[1].name)))
    origin, turned = judge.pose(frame or planner.arm.base_frame, np.array(start))
    place, turn = tuple((turned.T @ (position - origin)).tolist()), turned.T @ rotation
    forms = ["position", "near"] + (["orientation", "free axis", "pointing", "about"] if is_full else [])
    axis = unit(draw(WAYS))
    match draw(st.sampled_from(forms)):
        case "near":
            return PoseGoal(position=place, frame=frame, position_tolerance=0.01)
        case "orientation":
            return PoseGoal(position=place, frame=frame, orientation=quaternion_of(turn))
        case "free axis":
            return PoseGoal(position=place, frame=frame, orientation=quaternion_of(turn), free_axis=axis)
        case "pointing":
            along = tuple((turn @ np.array(axis)).tolist())
            return PoseGoal(position=place, frame=frame, tool_axis=axis, direction=along)
        case "about":
            return PoseGoal(
                position=place, frame=frame, orientation=quaternion_of(turn),
                position_tolerance=0.005, orientation_tolerance=0.1,
            )  # fmt: skip
    return PoseGoal(position=place, frame=frame)


@st.composite
def goals(draw: st.DrawFn, planner: Planner, start: Numbers) -> Goal:
    """One point to be at."""
    whole = joints(planner, configuration_at(planner, draw(SHARES)))
    return draw(
        st.one_of(
            st.just(whole),
            st.just(JointGoal(name=whole.name[1:2], position=whole.position[1:2])),
            st.sampled_from(sorted(planner.arm.named_states)).map(lambda name: NamedGoal(name=name)),
            pose_goals(planner, start),
        )
    )


@st.composite
def cases(draw: st.DrawFn, planner: Planner) -> tuple[PlanningScene, PlanRequest]:
    """Motions of the joints, free, point to point, by way of others, often with something in their way."""
    scene = draw(scenes())
    if draw(st.integers(0, 3)) == 0:
        scene = with_object(scene, held(planner, draw(SHAPES)))
    start, whole = draw(free_configurations(planner, scene)), draw(free_configurations(planner, scene))
    middle = planner.kinematics.tool(0.5 * np.add(start, whole)).position
    post = SceneObject(name="post", shape=draw(SHAPES), pose=Transform(translation=tuple(middle.tolist())))
    crowded, ends = with_object(scene, post), [np.array(start), np.array(whole)]
    if all(Judge(planner.arm, crowded).nearest(end).distance > 0.005 for end in ends):
        scene = crowded
    goal: Goal = draw(st.one_of(st.just(joints(planner, whole)), goals(planner, start)))
    timing = draw(st.sampled_from(Timing))
    if draw(st.integers(0, 4)) == 0:
        points = draw(st.lists(goals(planner, start), min_size=1, max_size=3))
        goal, timing = WaypointGoal(points=tuple(points), blend=draw(st.sampled_from((0.0, 0.02)))), Timing.JERK_LIMITED
    return scene, asked(
        planner, start, goal, timing=timing, motion=draw(st.one_of(FREE, FREE, st.just(PointToPoint()))),
        velocity_scaling=draw(SCALINGS), acceleration_scaling=draw(SCALINGS), allowed_time=1.0,
    )  # fmt: skip


@st.composite
def tool_cases(draw: st.DrawFn, planner: Planner, is_arc: bool) -> tuple[PlanningScene, PlanRequest]:
    """Lines of up to 15 cm, and arcs of a few, from where the tool is."""
    scene = draw(scenes())
    start = draw(free_configurations(planner, scene, INNER))
    position, rotation = Judge(planner.arm).tool(np.array(start))
    reach = 0.04 if is_arc else 0.15
    places = [tuple((position + draw(st.floats(0.005, reach)) * np.array(unit(draw(WAYS)))).tolist()) for _ in range(2)]
    turned = {"orientation": quaternion_of(rotation)} if draw(st.booleans()) and planner.arm.name == "parol6" else {}
    goal: Goal = PoseGoal(position=places[0], **turned)
    speed, acceleration = draw(st.sampled_from((0.0, 0.05))), draw(st.sampled_from((0.0, 0.2)))
    motion: Motion = CircularMotion(interim=places[1], speed=speed, acceleration=acceleration)
    if not is_arc:
        motion = LinearMotion(speed=speed, acceleration=acceleration, least_fraction=draw(st.sampled_from((0.0, 1.0))))
    return scene, asked(
        planner, start, goal, motion=motion, velocity_scaling=draw(SCALINGS), acceleration_scaling=draw(SCALINGS),
        allowed_time=1.0,
    )  # fmt: skip


@st.composite
def free_configurations(
    draw: st.DrawFn, planner: Planner, scene: PlanningScene, shares: st.SearchStrategy[Numbers] = SHARES
) -> Numbers:
    """The first of some that touches nothing, or the last of them."""
    judge = Judge(planner.arm, scene)
    configurations = [configuration_at(planner, draw(shares)) for _ in range(4)]
    free = (configuration for configuration in configurations if judge.nearest(np.array(configuration)).distance > 0.0)
    return next(free, configurations[-1])


def with_object(scene: PlanningScene, item: SceneObject) -> PlanningScene:
    return msgspec.structs.replace(scene, objects=(*scene.objects, item))
