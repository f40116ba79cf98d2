"""The allowed collision matrix by sampling: adjacent links, links rigid to one another, links always or never near.

As MoveIt's setup assistant does it, but what seems never to be near is also searched for nearer configurations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from services.arm.kinematics.kinematics import Kinematics
from services.arm.kinematics.self_collisions import LinkPair, SelfCollisionChecker
from services.arm.model.description import Arm
from services.arm.model.urdf import JointKind

Array = NDArray[np.float64]

SAMPLES = 4000
SEED = 0
SPARE = 0.001  # [m] beyond the arm's clearance, which must stay between two links for them to be never near
SEARCHES = 4  # from the nearest samples of a pair
STEPS = 60
SHRINK = 0.9


class DisabledReason(StrEnum):
    """Why a pair is not checked; an SRDF's other reasons are a person's."""

    ADJACENT = "Adjacent"
    RIGID = "Rigid"  # no joint moves them against one another
    ALWAYS = "Always"  # never farther apart than the clearance
    NEVER = "Never"


@dataclass(frozen=True)
class LinkPairData:
    """One pair of links; `reason` None: it can touch and is to be checked. `nearest`, `farthest` [m] as seen."""

    pair: LinkPair
    reason: DisabledReason | None
    nearest: float
    farthest: float


def collision_matrix(arm: Arm, samples: int = SAMPLES) -> list[LinkPairData]:
    """Every pair of links that have collision shapes; the same arm gives the same matrix."""
    kinematics = Kinematics(arm)
    bare = replace(arm, disabled_collisions=frozenset())
    checker = SelfCollisionChecker(bare, kinematics.model, kinematics.configuration, with_rigid=True)
    random = np.random.default_rng(SEED)
    configurations = _configurations(arm, samples, random)
    distances = [checker.distances(configuration) for configuration in configurations]
    return [_pair_data(arm, checker, pair, configurations, distances, random) for pair in checker.pairs]


def _pair_data(
    arm: Arm,
    checker: SelfCollisionChecker,
    pair: LinkPair,
    configurations: Array,
    distances: list[dict[LinkPair, float]],
    random: np.random.Generator,
) -> LinkPairData:
    seen = np.array([row[pair] for row in distances])
    nearest, farthest = float(seen.min()), float(seen.max())
    if are_adjacent(arm, *pair):
        return LinkPairData(pair, DisabledReason.ADJACENT, nearest, farthest)
    if are_rigid_links(arm, *pair):
        return LinkPairData(pair, DisabledReason.RIGID, nearest, farthest)
    if farthest <= arm.clearance:
        return LinkPairData(pair, DisabledReason.ALWAYS, nearest, farthest)
    never_below = arm.clearance + SPARE
    if nearest > never_below:
        starts = configurations[np.argsort(seen, kind="stable")[:SEARCHES]]
        nearest = min(nearest, *(_nearest_from(arm, checker, pair, start, random) for start in starts))
    return LinkPairData(pair, DisabledReason.NEVER if nearest > never_below else None, nearest, farthest)


def _nearest_from(
    arm: Arm, checker: SelfCollisionChecker, pair: LinkPair, start: Array, random: np.random.Generator
) -> float:
    """[m] by a random search in a shrinking neighbourhood."""
    lower, upper = _limits(arm)
    best, configuration = checker.distances(start)[pair], start
    reach = 0.2 * (upper - lower)
    for _ in range(STEPS):
        tried = np.clip(configuration + reach * random.uniform(-1.0, 1.0, len(start)), lower, upper)
        distance = checker.distances(tried)[pair]
        if distance < best:
            best, configuration = distance, tried
        else:
            reach = SHRINK * reach
    return best


def _configurations(arm: Arm, samples: int, random: np.random.Generator) -> Array:
    """(m, n) the named ones and random ones within the limits."""
    lower, upper = _limits(arm)
    named = [np.array(state) for state in arm.named_states.values()]
    return np.vstack([*named, random.uniform(lower, upper, (samples, len(lower)))])


def _limits(arm: Arm) -> tuple[Array, Array]:
    """(n,) each; a whole turn where there is none."""
    lower = np.array([joint.lower if math.isfinite(joint.lower) else -math.pi for joint in arm.joints])
    upper = np.array([joint.upper if math.isfinite(joint.upper) else math.pi for joint in arm.joints])
    return lower, upper


def are_adjacent(arm: Arm, first: str, second: str) -> bool:
    """True if one joint is between two links; links without a shape in between do not count."""
    return second in _neighbours(arm, first) or first in _neighbours(arm, second)


def are_rigid_links(arm: Arm, first: str, second: str) -> bool:
    """True if there are only fixed joints between two links."""
    return _rigid_root(arm, first) == _rigid_root(arm, second)


def _rigid_root(arm: Arm, link: str) -> str:
    """The link next to the moving joint, or the root, that carries `link` by fixed joints."""
    above = {joint.child: joint for joint in arm.model.joints}
    while link in above and above[link].kind is JointKind.FIXED:
        link = above[link].parent
    return link


def _neighbours(arm: Arm, link: str) -> Iterator[str]:
    """The nearest links with a shape on the way out from `link`."""
    shaped = {each.name for each in arm.model.links if each.collisions}
    for joint in arm.model.joints:
        if joint.parent == link:
            if joint.child in shaped:
                yield joint.child
            else:
                yield from _neighbours(arm, joint.child)
