"""The named states of an imported arm: `home` and `ready`, where nothing touches, and its SRDF."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from services.arm.errors import DescriptionError
from services.arm.kinematics.kinematics import Kinematics
from services.arm.kinematics.self_collisions import SelfCollisionChecker
from services.arm.model.description import ArmDescription
from services.arm.model.urdf import JointKind, UrdfJoint

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
CLEAR = 0.008  # [m] between links that may touch, in a named state: twice what plans keep, if any state has it
TIGHT = 0.001  # [m] that must be between them at least
TRIES = 3000
INSET = 0.01  # of the travel from a limit to `home`
ASIDE = 1e-3  # of the travel from a limit to any named state
READY = 0.4  # of the way from the middle to the limits, at most, for `ready`
# That one joint of `ready` must be away from `home`: so much [rad] or [m], or so large a share of its travel if less.
NEAREST_READY, NEAREST_READY_SHARE = 0.3, 0.2
SEED = 0


def zero_state(joints: Sequence[UrdfJoint]) -> dict[str, float]:
    """0 [rad] or [m] for every joint, or near the limit that is nearest to it."""
    lower, upper = np.array([_range(joint) for joint in joints]).T
    return dict(zip([joint.name for joint in joints], _zero(lower, upper).tolist(), strict=True))


def _zero(lower: Array, upper: Array) -> Array:
    inset = INSET * (upper - lower)
    inside = np.round(np.clip(0.0, lower + inset, upper - inset), 4)
    return np.where((lower <= 0.0) & (upper >= 0.0), 0.0, inside)


def named_states(arm: ArmDescription) -> dict[str, dict[str, float]]:
    """`home`, near zero, and `ready`, away from it [rad] or [m]; raises `DescriptionError` where none is free."""
    checker = Kinematics(arm).collisions
    urdf = [arm.model.joint(name) for name in arm.joint_names]
    lower, upper = np.array([_range(joint) for joint in urdf]).T
    home = _first_free(checker, states_around(_zero(lower, upper), lower, upper), "home", arm)
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    least = np.minimum(NEAREST_READY, NEAREST_READY_SHARE * (upper - lower))
    away = (
        each for each in states_around(middle + READY * 0.5 * half, lower, upper) if (abs(each - home) >= least).any()
    )
    ready = _first_free(checker, away, "ready", arm)
    inside = _inside(lower, upper)
    rounded = {"home": np.clip(np.round(home, 4), *inside), "ready": np.clip(np.round(ready, 4), *inside)}
    return {name: dict(zip(arm.joint_names, state.tolist(), strict=True)) for name, state in rounded.items()}


def states_around(center: Array, lower: Array, upper: Array) -> Iterator[Array]:
    """(n,) [rad] or [m] `center`, then random ones between `lower` and `upper` that lie farther and farther away."""
    random, (least, most) = np.random.default_rng(SEED), _inside(lower, upper)
    for number in range(TRIES):
        reach = number / TRIES * (upper - lower)
        yield np.clip(center + reach * random.uniform(-1.0, 1.0, len(center)), least, most)


def _inside(lower: Array, upper: Array) -> tuple[Array, Array]:
    """(n,) each: so far from the limits that a state lies within them also as the text of a file."""
    aside = ASIDE * (upper - lower)
    return lower + aside, upper - aside


def _first_free(checker: SelfCollisionChecker, states: Iterator[Array], name: str, arm: ArmDescription) -> Array:
    """(n,) [rad] or [m] the first that is CLEAR, else the one with the most room if that is above TIGHT."""
    best, most = np.empty(0), -math.inf
    for state in states:
        distance = checker.distance(state)
        if distance > CLEAR:
            return state
        if distance > most:
            best, most = state, distance
    if most > TIGHT:
        return best
    touching = ", ".join(f"{first} and {second}" for first, second in checker.pairs_within(best, TIGHT)) or "none"
    raise DescriptionError(
        f'{arm.name}: no configuration of {TRIES} is free of contact for the state "{name}"; in the best one touch: '
        f"{touching}. See with `gemelo collision matrix` how near they are elsewhere, and correct shapes or limits"
    )


def _range(joint: UrdfJoint) -> tuple[float, float]:
    """[rad] or [m]; a turn for a joint without limits."""
    if joint.kind is JointKind.CONTINUOUS or joint.limit is None:
        return -math.pi, math.pi
    return joint.limit.lower, joint.limit.upper


def srdf_text(name: str, joints: Sequence[str], states: Mapping[str, Mapping[str, float]]) -> str:
    """An SRDF with the group `arm` and its states [rad] or [m], and no pair of links yet."""
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>", '  <group name="arm">']
    lines += [f"    <joint name={quoteattr(joint)}/>" for joint in joints]
    lines += ["  </group>"]
    for state, values in states.items():
        lines.append(f'  <group_state name={quoteattr(state)} group="arm">')
        lines += [f'    <joint name={quoteattr(joint)} value="{values[joint]:.9g}"/>' for joint in joints]
        lines.append("  </group_state>")
    return "\n".join([*lines, "</robot>", ""])
