"""The allowed collision matrix by sampling: adjacent links, links rigid to one another, links always or never near.

As MoveIt's setup assistant does it, but what seems never to be near is also searched for nearer configurations.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.drawn_links import DrawnLinks
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.link_distances import LinkDistances
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.schemas.reasons import Reason, because

Array = NDArray[np.float64]

SAMPLES = 4000
SEED = 0
SPARE = 0.001  # [m] beyond the arm's clearance, which must stay between two links for them to be never near
SEARCHES = 4  # from the nearest samples of a pair
STEPS = 60
SHRINK = 0.9
LOOKS = 40  # samples of a pair that are looked at on either side, where that settles it
HINGE = 0.002  # [m] by which the distance of two parts of one hinge may change
DEEPEST = 4  # samples in which a pair that is always near is looked at as it is drawn
SAYING = 2.0  # [s] between two words of how far it is


class DisabledReason(StrEnum):
    """Why a pair is not checked; an SRDF's other reasons are a person's."""

    ADJACENT = "Adjacent"
    RIGID = "Rigid"  # no joint moves them against one another
    ALWAYS = "Always"  # never farther apart than the clearance, or what is given for it
    NEVER = "Never"


@dataclass(frozen=True)
class LinkPairData:
    """One pair of links; `reason` None: it can touch and is to be checked. `nearest`, `farthest` [m] as seen."""

    pair: LinkPair
    reason: DisabledReason | None
    nearest: float
    farthest: float
    is_doubtful: bool = False  # always near, and yet it comes to touch: a person may excuse it


def _tell_nobody(_: Reason) -> None:
    pass


def collision_matrix(
    arm: ArmDescription,
    samples: int = SAMPLES,
    tell: Callable[[Reason], None] = _tell_nobody,
    always_within: float | None = None,
) -> list[LinkPairData]:
    """Every pair of links that have collision shapes; the same arm gives the same matrix. `tell` gets the progress.

    Links that can touch and are never farther apart than `always_within` [m], else the clearance, are always near:
    unless what they look like is apart in some samples and touches in the deepest ones, which is doubtful.
    """
    began = time.monotonic()
    kinematics = Kinematics(arm)
    random = np.random.default_rng(SEED)
    configurations = _configurations(arm, samples, random)
    links = LinkDistances(arm, kinematics.model, kinematics.configuration, configurations)
    tell(because("fit.pairs.sampled", count=len(configurations), time=time.monotonic() - began))
    drawn = DrawnLinks(arm, kinematics.model, kinematics.configuration)
    within = arm.clearance if always_within is None else always_within
    found, said = [], time.monotonic()
    for number in range(len(links.pairs)):
        found.append(_pair_data(arm, links, number, configurations, random, within, drawn))
        if time.monotonic() - said > SAYING:
            seconds = time.monotonic() - began
            tell(because("fit.pairs.seen", number=number + 1, count=len(links.pairs), time=seconds))
            said = time.monotonic()
    return found


def _pair_data(
    arm: ArmDescription,
    links: LinkDistances,
    number: int,
    configurations: Array,
    random: np.random.Generator,
    within: float,
    drawn: DrawnLinks,
) -> LinkPairData:
    pair, never_below = links.pairs[number], arm.clearance + SPARE
    is_settled = are_adjacent(arm, *pair) or are_rigid_links(arm, *pair)
    seen = _nearest_samples(links, number, configurations, math.inf if is_settled else never_below)
    nearest = min(seen.values())
    farthest = max(nearest, _farthest(links, number, configurations, -math.inf if is_settled else within))
    if are_adjacent(arm, *pair):
        return LinkPairData(pair, DisabledReason.ADJACENT, nearest, farthest)
    if are_rigid_links(arm, *pair):
        return LinkPairData(pair, DisabledReason.RIGID, nearest, farthest)
    if farthest <= within and nearest <= never_below:
        seen = _nearest_samples(links, number, configurations, -math.inf)
        nearest = min(seen.values())
        is_doubtful = farthest - nearest > HINGE and nearest <= 0.0 < farthest
        if is_doubtful:
            deepest = sorted(seen, key=lambda sample: (seen[sample], sample))[:DEEPEST]
            outer = np.argsort(-links.bounds[:, number, 1], kind="stable")[:LOOKS].tolist()
            outer = sorted(outer, key=lambda sample: -links.distance(pair, configurations[sample]))[:DEEPEST]
            is_doubtful = drawn.come_to_touch(pair, configurations[deepest], configurations[outer])
        reason = None if is_doubtful else DisabledReason.ALWAYS
        return LinkPairData(pair, reason, nearest, farthest, is_doubtful)
    if nearest > never_below:
        starts = configurations[sorted(seen, key=lambda sample: (seen[sample], sample))[:SEARCHES]]
        nearest = min(nearest, *(_nearest_from(arm, links, pair, start, random) for start in starts))
    return LinkPairData(pair, DisabledReason.NEVER if nearest > never_below else None, nearest, farthest)


def _nearest_samples(links: LinkDistances, number: int, configurations: Array, enough: float) -> dict[int, float]:
    """Distances [m] by samples: the nearest, and all that may be nearer than `enough` [m] until one of them is."""
    least, found, best = links.bounds[:, number, 0], dict[int, float](), math.inf
    for sample in np.argsort(least, kind="stable").tolist():
        if least[sample] > best or (len(found) >= LOOKS and (best <= enough or least[sample] > enough)):
            break
        found[sample] = links.distance(links.pairs[number], configurations[sample])
        best = min(best, found[sample])
    return found


def _farthest(links: LinkDistances, number: int, configurations: Array, enough: float) -> float:
    """[m] of the samples that may be the farthest: of all until one is farther than `enough` [m]."""
    most, best = links.bounds[:, number, 1], -math.inf
    for count, sample in enumerate(np.argsort(-most, kind="stable").tolist()):
        if most[sample] <= best or (count >= LOOKS and best > enough):
            break
        best = max(best, links.distance(links.pairs[number], configurations[sample]))
    return best


def _nearest_from(
    arm: ArmDescription, links: LinkDistances, pair: LinkPair, start: Array, random: np.random.Generator
) -> float:
    """[m] by a random search in a shrinking neighbourhood."""
    lower, upper = _limits(arm)
    best, configuration = links.distance(pair, start), start
    reach = 0.2 * (upper - lower)
    for _ in range(STEPS):
        tried = np.clip(configuration + reach * random.uniform(-1.0, 1.0, len(start)), lower, upper)
        distance = links.distance(pair, tried, best)
        if distance < best:
            best, configuration = distance, tried
        else:
            reach = SHRINK * reach
    return best


def _configurations(arm: ArmDescription, samples: int, random: np.random.Generator) -> Array:
    """(m, n) the named ones and random ones within the limits."""
    lower, upper = _limits(arm)
    named = [np.array(state) for state in arm.named_states.values()]
    return np.vstack([*named, random.uniform(lower, upper, (samples, len(lower)))])


def _limits(arm: ArmDescription) -> tuple[Array, Array]:
    """(n,) each; a whole turn where there is none."""
    lower = np.array([joint.lower if math.isfinite(joint.lower) else -math.pi for joint in arm.joints])
    upper = np.array([joint.upper if math.isfinite(joint.upper) else math.pi for joint in arm.joints])
    return lower, upper


def are_adjacent(arm: ArmDescription, first: str, second: str) -> bool:
    """True if one joint is between two links; links without a shape in between do not count."""
    return second in _neighbours(arm, first) or first in _neighbours(arm, second)


def are_rigid_links(arm: ArmDescription, first: str, second: str) -> bool:
    """True if there are only fixed joints between two links."""
    return _rigid_root(arm, first) == _rigid_root(arm, second)


def _rigid_root(arm: ArmDescription, link: str) -> str:
    """The link next to the moving joint, or the root, that carries `link` by fixed joints."""
    above = {joint.child: joint for joint in arm.model.joints}
    while link in above and above[link].kind is JointKind.FIXED:
        link = above[link].parent
    return link


def _neighbours(arm: ArmDescription, link: str) -> Iterator[str]:
    """The nearest links with a shape on the way out from `link`."""
    shaped = {each.name for each in arm.model.links if each.collisions}
    for joint in arm.model.joints:
        if joint.parent == link:
            if joint.child in shaped:
                yield joint.child
            else:
                yield from _neighbours(arm, joint.child)
