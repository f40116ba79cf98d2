"""Scenes with narrow passages, for arms that reach about 0.8 m: slots, shelves and bars, into and out of which the hand
fits with some 3 cm of play."""

from __future__ import annotations

import math

import numpy as np

from gemelo.schemas.message import Vector
from gemelo.schemas.scene import SceneObject
from gemelo.tools.bench.any_arm.families import (
    FORWARD,
    THICK,
    Family,
    Setting,
    ToolPose,
    board,
    cylinder,
    pose,
    scene_of,
)

FLAT = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))  # as FORWARD, the hand's wide side level
HAND = 0.09  # [m] that a hand is thick, the largest of the arms
PLAY = 0.03  # [m] more that a passage is wide; a little more is drawn
TURN = 0.05  # [rad] about its own axis that a tool may be turned either way
BARS = 26  # on a full circle
AROUND = 0.52  # [m] radius of the circle


def slots(random: np.random.Generator) -> Setting:
    """Out of one upright slot of a wall and into the other one: a trap for all that grows towards the goal."""
    x, wide = random.uniform(0.42, 0.5), HAND + PLAY + random.uniform(0.0, 0.02)
    apart, low, high = random.uniform((0.3, 0.12, 0.4), (0.5, 0.25, 0.5)).tolist()
    half, top = apart / 2, 1.4
    things = [
        wall("between", x, (-half + wide / 2, half - wide / 2), (low, low + high)),
        wall("left", x, (half + wide / 2, 1.0), (low, low + high)),
        wall("right", x, (-1.0, -half - wide / 2), (low, low + high)),
        wall("below", x, (-1.0, 1.0), (0.0, low)),
        wall("above", x, (-1.0, 1.0), (low + high, top)),
    ]
    ends = [
        aimed(random, (x + random.uniform(0.06, 0.14), side * half, low + random.uniform(0.35, 0.65) * high), FORWARD)
        for side in random.permutation((-1.0, 1.0)).tolist()
    ]
    return Setting(scene_of(things), *ends)


def tight_shelves(random: np.random.Generator) -> Setting:
    """From one compartment into another one above or below it, the hand held level."""
    x, wide, deep = random.uniform((0.45, 0.5, 0.2), (0.55, 0.8, 0.3)).tolist()
    gap = HAND + PLAY + random.uniform(0.0, 0.02)
    bottom, rows = random.uniform(0.15, 0.3), 4
    pitch = gap + THICK
    high = rows * pitch
    things = [
        board("back", (THICK, wide, high), (x + deep + THICK / 2, 0.0, bottom + high / 2)),
        board("left", (deep, THICK, high), (x + deep / 2, wide / 2, bottom + high / 2)),
        board("right", (deep, THICK, high), (x + deep / 2, -wide / 2, bottom + high / 2)),
        *(
            board(f"board {row}", (deep, wide, THICK), (x + deep / 2, 0.0, bottom + row * pitch))
            for row in range(rows + 1)
        ),
    ]
    ends = [
        aimed(
            random,
            (x + random.uniform(0.05, 0.12), random.uniform(-0.25, 0.25) * wide, bottom + (row + 0.5) * pitch),
            FLAT,
        )
        for row in random.permutation(rows)[:2].tolist()
    ]
    return Setting(scene_of(things), *ends)


def barred(random: np.random.Generator) -> Setting:
    """From between two bars of a cage around the arm to between two others."""
    step = math.tau / BARS
    things = [
        cylinder(f"bar {bar}", 0.008, 1.4, (AROUND * math.cos(bar * step), AROUND * math.sin(bar * step), 0.7))
        for bar in range(BARS)
    ]
    first = int(random.integers(BARS))
    second = first + int(random.choice((-1, 1))) * int(random.integers(2, 8))
    ends = [
        through(random, (gap + 0.5) * step, AROUND + random.uniform(0.03, 0.1), random.uniform(0.25, 0.6))
        for gap in (first, second)
    ]
    return Setting(scene_of(things), *ends)


NARROW: dict[str, Family] = {"slots": slots, "tight shelves": tight_shelves, "barred cage": barred}


def wall(name: str, x: float, along: tuple[float, float], up: tuple[float, float]) -> SceneObject:
    """An upright board across x [m] from one y to another and one height to another [m]."""
    (left, right), (low, high) = along, up
    return board(name, (THICK, right - left, high - low), (x, 0.5 * (left + right), 0.5 * (low + high)))


def aimed(random: np.random.Generator, position: Vector, axes: tuple[Vector, ...]) -> ToolPose:
    """The tool at `position` (3,) [m] with these axes, hardly turned."""
    return pose(random, position, axes, TURN)


def through(random: np.random.Generator, angle: float, away: float, height: float) -> ToolPose:
    """The tool pointing outwards at `angle` [rad] around the base, `away` and `height` [m] from it, its wide side
    upright."""
    cosine, sine = math.cos(angle), math.sin(angle)
    axes = ((-sine, cosine, 0.0), (0.0, 0.0, 1.0), (cosine, sine, 0.0))
    return aimed(random, (away * cosine, away * sine, height), axes)
