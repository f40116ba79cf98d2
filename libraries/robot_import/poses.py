"""The named states of an imported arm: `home` and `ready`, where nothing touches, and its SRDF."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.schemas.reasons import Reason, Value, because

Array = NDArray[np.float64]
Wanted = Callable[[Array], bool]  # of a state (n,) [rad] or [m]

# Tuning constants: chosen, where a line does not say measured or standard.
CLEAR = 0.008  # [m] between links that may touch, in a named state: twice what plans keep, if any state has it
TIGHT = 0.001  # [m] that must be between them at least
TRIES = 3000
LOOKS = 400  # states that are looked at for how far apart a pair can be
SHARE_OF_MOST = 0.9  # of that, which is as much room as there can be
HALVINGS = 12
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


@dataclass(frozen=True)
class NamedStates:
    """The states by name, each by joint [rad] or [m], and why each is not where one expects it that is not there."""

    states: dict[str, dict[str, float]]
    said: tuple[Reason, ...]


def named_states(arm: ArmDescription, given: Mapping[str, Mapping[str, float]]) -> NamedStates:
    """`home`, near zero, and `ready`, away from it [rad] or [m], with the joints at the values that are `given` for
    them; raises `DescriptionError` where none is free."""
    room = Room(arm)
    lower, upper = limits_of(arm)
    zero = _zero(lower, upper)
    fixed = {name: _pinned(arm, given.get(name, {})) for name in ("home", "ready")}
    home = _first_free(room, np.where(np.isnan(fixed["home"]), zero, fixed["home"]), fixed["home"], "home", arm)
    said = tuple(_not_at_zero(room, home, zero, arm, fixed["home"]))
    middle, half = (lower + upper) / 2.0, (upper - lower) / 2.0
    least = np.minimum(NEAREST_READY, NEAREST_READY_SHARE * (upper - lower))

    def is_away(state: Array) -> bool:
        return bool((abs(state - home) >= least).any())

    away = None if "ready" in given else is_away
    center = np.where(np.isnan(fixed["ready"]), middle + READY * 0.5 * half, fixed["ready"])
    ready = _first_free(room, center, fixed["ready"], "ready", arm, away)
    inside = _inside(lower, upper)
    states = {}
    for name, state in (("home", home), ("ready", ready)):
        free = np.isnan(fixed[name])
        rounded = np.where(free, np.clip(np.round(state, 4), *inside), state)
        states[name] = dict(zip(arm.joint_names, rounded.tolist(), strict=True))
    return NamedStates(states, said)


def _pinned(arm: ArmDescription, values: Mapping[str, float]) -> Array:
    """(n,) the given values, nan for the other joints."""
    return np.array([values.get(name, math.nan) for name in arm.joint_names])


def limits_of(arm: ArmDescription) -> tuple[Array, Array]:
    """(n,) each [rad] or [m]."""
    lower, upper = np.array([_range(arm.model.joint(name)) for name in arm.joint_names]).T
    return lower, upper


class Room:
    """How much of the room that there can be each pair of links has in a state."""

    def __init__(self, arm: ArmDescription) -> None:
        self.checker = Kinematics(arm).collisions
        self._wanted: dict[LinkPair, float] = {}  # [m] less than CLEAR, of pairs that never have that
        lower, upper = limits_of(arm)
        random = np.random.default_rng(SEED)
        zero = _zero(lower, upper)
        tight = {pair: apart for pair, apart in self.checker.distances(zero).items() if apart <= CLEAR}
        for number in range(LOOKS if tight else 0):
            one = np.arange(len(zero)) == number % len(zero)
            inside = random.uniform(*_inside(lower, upper))
            state = np.where(one, inside, zero) if number < LOOKS // 2 else inside
            apart = self.checker.distances(state)
            tight = {pair: max(most, apart[pair]) for pair, most in tight.items() if most <= CLEAR}
            if not tight:
                break
        for pair, most in tight.items():
            if most <= CLEAR:
                self._wanted[pair] = max(TIGHT, SHARE_OF_MOST * most)

    def is_clear(self, state: Array) -> bool:
        """True if in `state` (n,) [rad] or [m] every pair is CLEAR, or nearly as far apart as it can be where that is
        less."""
        if not self._wanted:
            return self.checker.distance(state) > CLEAR
        return all(apart > self._wanted.get(pair, CLEAR) for pair, apart in self.checker.distances(state).items())


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


def _first_free(
    room: Room, center: Array, fixed: Array, name: str, arm: ArmDescription, is_wanted: Wanted | None = None
) -> Array:
    """(n,) [rad] or [m] the state nearest to `center` with as much room as there can be, else the one with the most
    room if that is above TIGHT; the joints that are `fixed` stay. Where all are, they are a person's."""
    lower, upper = limits_of(arm)
    free = np.isnan(fixed)
    best, most = np.empty(0), -math.inf
    for drawn in states_around(center, lower, upper):
        state = np.where(free, drawn, center)
        if is_wanted is not None and not is_wanted(state):
            continue
        if room.is_clear(state):
            return _pulled_back(room.is_clear, state, center, is_wanted)
        distance = room.checker.distance(state)
        if distance > most:
            best, most = state, distance
        if not free.any():
            return state
    if most > TIGHT:
        least = SHARE_OF_MOST * most
        return _pulled_back(lambda each: room.checker.distance(each) >= least, best, center, is_wanted)
    touching = [because("import.touching", first=a, second=b) for a, b in room.checker.pairs_within(best, TIGHT)]
    tried: dict[str, Value] = {"robot": arm.name, "tries": TRIES, "state": name}
    if not touching:
        raise DescriptionError(because("import.state.none", **tried))
    raise DescriptionError(because("import.state.touching", *touching, **tried))


def _pulled_back(is_free: Wanted, state: Array, center: Array, is_wanted: Wanted | None) -> Array:
    """(n,) `state` with each joint as near to `center` as it may be while the state is free, one after the other."""

    def is_good(tried: Array) -> bool:
        return is_free(tried) and (is_wanted is None or is_wanted(tried))

    for _ in range(2):
        for joint in np.argsort(-abs(state - center)):
            near, far = center[joint], state[joint]
            here = np.arange(len(state)) == joint
            if near == far:
                continue
            if is_good(np.where(here, near, state)):
                state = np.where(here, near, state)
                continue
            for _ in range(HALVINGS):
                middle = 0.5 * (near + far)
                near, far = (near, middle) if is_good(np.where(here, middle, state)) else (middle, far)
            state = np.where(here, far, state)
    return state


def _not_at_zero(room: Room, home: Array, zero: Array, arm: ArmDescription, fixed: Array) -> Iterator[Reason]:
    """Why `home` is not zero, with the pair that is too near there."""
    if not np.isnan(fixed).any():
        return
    moved = {name: float(value) for name, value in zip(arm.joint_names, home, strict=True) if abs(value) > ASIDE}
    if not moved:
        return
    apart = room.checker.distances(zero)
    pair = min(apart, key=lambda each: apart[each], default=None)
    if pair is not None and apart[pair] <= CLEAR and (abs(home - zero) > ASIDE).any():
        links = dict(zip(("first", "second"), pair, strict=True))
        near = because("mend.home.touching", joints=moved, **links)
        if apart[pair] > 0.0:
            near = because("mend.home.near", joints=moved, distance=float(apart[pair]), **links)
        yield near
    else:
        yield because("mend.home.limits", joints=moved)


def _range(joint: UrdfJoint) -> tuple[float, float]:
    """[rad] or [m]; a turn for a joint without limits."""
    if joint.kind is JointKind.CONTINUOUS or joint.limit is None:
        return -math.pi, math.pi
    return joint.limit.lower, joint.limit.upper


def srdf_text(
    name: str, joints: Sequence[str], states: Mapping[str, Mapping[str, float]], more: Sequence[str] = ()
) -> str:
    """An SRDF with the group `arm` and its states [rad] or [m], `more` lines, and no pair of links yet."""
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(name)}>", '  <group name="arm">']
    lines += [f"    <joint name={quoteattr(joint)}/>" for joint in joints]
    lines += ["  </group>"]
    for state, values in states.items():
        lines.append(f'  <group_state name={quoteattr(state)} group="arm">')
        lines += [f'    <joint name={quoteattr(joint)} value="{values[joint]:.9g}"/>' for joint in joints]
        lines.append("  </group_state>")
    return "\n".join([*lines, *more, "</robot>", ""])
