"""Scenes by family and seed, about as large as an arm that reaches 0.8 m, and where in them the tool is to be.

The families are those on which planners are compared in the literature (Chamzas et al. 2022, MotionBenchMaker), drawn
by code of our own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Vector
from gemelo.schemas.scene import CylinderShape, PlanningScene, SceneObject
from gemelo.tools.bench.scenes import box

Array = NDArray[np.float64]

DOWN = ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))  # columns of the tool's rotation: x, y, z
FORWARD = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
THICK = 0.03  # [m] of boards
FEWEST, MOST = 5, 40  # solids of a cage
TURN = 0.4  # [rad] about its own axis that a tool may be turned either way


@dataclass(frozen=True)
class ToolPose:
    """`position` (3,) [m] and `rotation` (3, 3) of the tool in the base."""

    position: Array
    rotation: Array


@dataclass(frozen=True)
class Setting:
    """A scene, and where the tool begins and ends; any free configuration will do where that is None."""

    scene: PlanningScene
    start: ToolPose | None
    goal: ToolPose | None


def table_pick(random: np.random.Generator) -> Setting:
    """From above a table down to its top, among cylinders and boxes that stand on it."""
    top = random.uniform(0.05, 0.25)
    things = [board("table", (0.6, 1.2, THICK), (0.62, 0.0, top - THICK / 2))]
    x, y = random.uniform((0.42, -0.3), (0.62, 0.3)).tolist()
    for index in range(int(random.integers(3, 9))):
        angle, away = random.uniform((-math.pi, 0.13), (math.pi, 0.4)).tolist()
        place = (x + away * math.cos(angle), y + away * math.sin(angle))
        if 0.35 < place[0] < 0.9:
            things.append(standing(f"thing {index}", random, place, top))
    goal = pose(random, (x, y, top + random.uniform(0.01, 0.08)), DOWN)
    above = pose(random, random.uniform((0.35, -0.5, top + 0.3), (0.6, 0.5, top + 0.5)).tolist(), DOWN)
    return Setting(scene_of(things), above, goal)


def under_table(random: np.random.Generator) -> Setting:
    """From above a table on four legs to below it, with a few things there."""
    top = random.uniform(0.42, 0.55)
    things = [board("table", (0.5, 1.0, THICK), (0.62, 0.0, top - THICK / 2))]
    for index in range(4):
        corner = (0.62 + (0.21 if index % 2 else -0.21), 0.44 if index < 2 else -0.44, (top - THICK) / 2)
        things.append(cylinder(f"leg {index}", 0.025, top - THICK, corner))
    things += [
        standing(f"thing {index}", random, random.uniform((0.5, -0.35), (0.8, 0.35)).tolist(), 0.0)
        for index in range(int(random.integers(1, 4)))
    ]
    goal = pose(random, random.uniform((0.5, -0.3, 0.15), (0.62, 0.3, top - 0.15)).tolist(), FORWARD)
    above = pose(random, random.uniform((0.4, -0.4, top + 0.12), (0.55, 0.4, top + 0.3)).tolist(), DOWN)
    return Setting(scene_of(things), above, goal)


def open_box(random: np.random.Generator) -> Setting:
    """From beside an open box down into it."""
    side, high = random.uniform((0.3, 0.15), (0.42, 0.28)).tolist()
    x, y, low = random.uniform((0.45, -0.25, 0.0), (0.58, 0.25, 0.15)).tolist()
    half = side / 2
    things = [board("floor", (side, side, 0.02), (x, y, low + 0.01))]
    for name, dx, dy in (("front", -half, 0.0), ("back", half, 0.0), ("left", 0.0, half), ("right", 0.0, -half)):
        edges = (0.02, side + 0.02, high) if dx else (side + 0.02, 0.02, high)
        things.append(board(name, edges, (x + dx, y + dy, low + high / 2)))
    inside = random.uniform((-0.2 * side, -0.2 * side), (0.2 * side, 0.2 * side)).tolist()
    goal = pose(random, (x + inside[0], y + inside[1], low + random.uniform(0.05, 0.12)), DOWN)
    beside = -1.0 if y > 0.0 else 1.0
    start = pose(random, (random.uniform(0.35, 0.55), beside * random.uniform(0.3, 0.5), low + 0.2), DOWN)
    return Setting(scene_of(things), start, goal)


def shelves(random: np.random.Generator) -> Setting:
    """From one compartment of three shelves into another."""
    x, wide, deep = random.uniform((0.62, 0.7, 0.25), (0.72, 1.0, 0.32)).tolist()
    gap = random.uniform(0.28, 0.34)
    bottom = random.uniform(0.05, 0.15)
    high = 3 * gap
    things = [board("back", (THICK, wide, high), (x + deep / 2 + THICK / 2, 0.0, bottom + high / 2))]
    for side, name in ((wide / 2, "left"), (-wide / 2, "right")):
        things.append(board(name, (deep, THICK, high), (x, side, bottom + high / 2)))
    things += [board(f"board {index}", (deep, wide, THICK), (x, 0.0, bottom + index * gap)) for index in range(4)]
    first, second = random.permutation(3)[:2].tolist()
    for index in range(int(random.integers(1, 5))):
        place = (x + deep / 4, random.uniform(-0.4, 0.4) * wide)
        things.append(
            standing(f"thing {index}", random, place, bottom + THICK / 2 + int(random.integers(3)) * gap, 0.15)
        )
    ends = [
        pose(
            random,
            (x - deep / 2 + random.uniform(0.0, 0.12), random.uniform(-0.3, 0.3) * wide, bottom + (row + 0.5) * gap),
            FORWARD,
        )
        for row in (first, second)
    ]
    return Setting(scene_of(things), *ends)


def cage(random: np.random.Generator) -> Setting:
    """From anywhere to anywhere among 5 to 40 boxes and cylinders all around."""
    things: list[SceneObject] = []
    for index in range(int(random.integers(FEWEST, MOST + 1))):
        angle, away, height = random.uniform((-math.pi, 0.38, 0.05), (math.pi, 0.85, 0.9)).tolist()
        place = (away * math.cos(angle), away * math.sin(angle), height)
        edges = random.uniform(0.04, 0.14, 3).tolist()
        if random.uniform() < 0.5:
            thing = board(f"thing {index}", (edges[0], edges[1], edges[2]), place)
        else:
            thing = cylinder(f"thing {index}", edges[0] / 2, random.uniform(0.08, 0.5), place)
        half = random.uniform(0.0, math.pi) / 2
        things.append(turned(thing, half))
    return Setting(scene_of(things), None, None)


Family = Callable[[np.random.Generator], Setting]
FAMILIES: dict[str, Family] = {
    "table pick": table_pick,
    "under table": under_table,
    "box": open_box,
    "three shelves": shelves,
    "cage": cage,
}


def settings(family: str, seed: int, families: Mapping[str, Family] = FAMILIES) -> Iterator[Setting]:
    """The settings of a problem, one after the other until one can be used; the same ones in every run."""
    random = np.random.default_rng((list(families).index(family), seed))
    while True:
        yield families[family](random)


def board(name: str, edges: Vector, place: Vector) -> SceneObject:
    """A box with these edges [m] around `place` [m]."""
    return box(name, edges, place)


def cylinder(name: str, radius: float, length: float, place: Vector) -> SceneObject:
    """A cylinder of `radius` and `length`, upright around `place`; all in [m]."""
    return SceneObject(name=name, shape=CylinderShape(radius=radius, length=length), pose=Transform(translation=place))


def standing(
    name: str, random: np.random.Generator, place: list[float] | tuple[float, float], ground: float, most: float = 0.28
) -> SceneObject:
    """A cylinder or a box upright at `place` (2,) [m], at most `most` [m] high."""
    x, y = place
    high, wide = random.uniform((0.08, 0.04), (most, 0.1)).tolist()
    centre = (x, y, ground + high / 2 + 0.001)
    if random.uniform() < 0.5:
        return cylinder(name, wide / 2, high, centre)
    return board(name, (wide, random.uniform(0.04, 0.1), high), centre)


def turned(thing: SceneObject, half: float) -> SceneObject:
    """The thing turned about the diagonal of x and y by twice `half` [rad]."""
    sine = math.sin(half) / math.sqrt(2.0)
    rotation = (sine, sine, 0.0, math.cos(half))
    return msgspec.structs.replace(thing, pose=Transform(translation=thing.pose.translation, rotation=rotation))


def scene_of(things: list[SceneObject]) -> PlanningScene:
    """The things, and a floor below the arm's base."""
    return PlanningScene(version=1, objects=(board("ground", (3.0, 3.0, 0.02), (0.0, 0.0, -0.015)), *things))


def pose(
    random: np.random.Generator, position: Vector | list[float], axes: tuple[Vector, ...], most: float = TURN
) -> ToolPose:
    """The tool at `position` (3,) [m] with these axes, turned at random by `most` [rad] about its own z."""
    angle = random.uniform(-most, most)
    sine, cosine = math.sin(angle), math.cos(angle)
    spin = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return ToolPose(np.array(position), np.array(axes).T @ spin)
