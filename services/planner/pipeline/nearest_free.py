"""The nearest configuration free of contact for an arm that touches something slightly, and the jog to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.reasons import Remedy, remedy
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.jog.jog_obstacles import CONTACT_SPEED, comes_away
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.request.deadline import Deadline

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SPARE = 0.001  # [m] beyond the clearance that is clear of everything there, so that a plan can begin
NEAREST, FARTHEST, GROWTH = 0.003, 0.15, 1.25  # [m] that any point of the arm moves at most on the ways that are tried
DIRECTIONS = 24  # of all joints together, at each distance, besides those of one joint
LEAST_REACH = 0.02  # [m/rad] of a joint that moves hardly anything; chosen: so it turns no more than some radians
LOOKS = 8  # at what touches, along a path; chosen: each is a check on the exact shapes
LEAST_SECONDS, SHARE = 0.5, 0.7  # and of a joint's velocity limit at most
DECIMALS, TINY = 4, 1e-4  # of [rad] or [m], in which a configuration is told; what moves less does not move


@dataclass(frozen=True)
class FreeConfiguration:
    """A configuration (n,) [rad] or [m], and whether what touches only comes away on the straight path there, as
    jogging demands."""

    configuration: Start
    can_be_jogged: bool


def nearest_free(
    arm: ArmDescription, checker: CollisionChecker, start: Start, deadline: Deadline
) -> FreeConfiguration | None:
    """The nearest free configuration to `start` (n,) [rad] or [m] that can be jogged to, or else the nearest; None
    where there is none near."""
    nearest: FreeConfiguration | None = None
    for row in _around(arm, checker.reach, np.array(start)):
        if deadline.has_passed():
            break
        if checker.keeps(row, checker.clearance + SPARE):
            found = FreeConfiguration(tuple(row.tolist()), _comes_away(checker, np.array(start), row))
            if found.can_be_jogged:
                return found
            nearest = nearest or found
    return nearest


def jog_out(arm: ArmDescription, reach: Array, start: Start, configuration: Start) -> Remedy:
    """The jog that moves from `start` to `configuration`, (n,) [rad] or [m]; `reach` (n,) [m/rad] or [m/m] as a
    world's."""
    moves = [after - before for before, after in zip(start, configuration, strict=True)]
    fastest = max(abs(move) / joint.velocity for joint, move in zip(arm.joints, moves, strict=True))
    needed = max(LEAST_SECONDS, float(np.abs(moves) @ reach) / CONTACT_SPEED, fastest / SHARE)
    seconds = math.ceil(10.0 * needed) / 10.0
    speeds = tuple(
        _speed(joint, move / seconds) for joint, move in zip(arm.joints, moves, strict=True) if abs(move) > TINY
    )
    return remedy("jog_out", speeds=" ".join(speeds), seconds=seconds)


def _speed(joint: Joint, velocity: float) -> str:
    """As `gemelo jog` takes it."""
    if joint.unit == "rad":
        return f"{joint.name}={math.degrees(velocity):.3g}deg/s"
    return f"{joint.name}={1000.0 * velocity:.3g}mm/s"


def _around(arm: ArmDescription, reach: Array, start: Array) -> Iterator[Array]:
    """Configurations within the limits, the near ones first: of one joint moved, then of all; the same every time."""
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    random, size = np.random.default_rng(0), len(start)
    away = NEAREST
    while away < FARTHEST:
        mixed = random.normal(size=(DIRECTIONS, size))
        mixed /= np.abs(mixed).sum(axis=1, keepdims=True)
        for direction in np.vstack((np.eye(size), -np.eye(size), mixed)):
            row = np.round(start + away * direction / np.maximum(reach, LEAST_REACH), DECIMALS)
            if (lower <= row).all() and (row <= upper).all():
                yield row
        away *= GROWTH


def _comes_away(checker: CollisionChecker, start: Array, end: Array) -> bool:
    """True if no pair that is closer than the clearance gets closer along the straight joint path."""
    before: dict[tuple[str, str], float] | None = None
    for share in np.linspace(0.0, 1.0, LOOKS + 1).tolist():
        near = checker.contacts(start + share * (end - start), checker.clearance)
        now = {(each.first, each.second): each.distance for each in near}
        if before is not None and any(
            not comes_away(before.get(pair, math.inf), distance) for pair, distance in now.items()
        ):
            return False
        before = now
    return True
