"""Fast checks of collisions: by the native planner, or none where that is not built.

Both stand behind `SphereCheck`: what it says is certain, and what it leaves unresolved is for coal on the exact shapes.
"""

from __future__ import annotations

import math
import threading
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.native_scene import native_scene
from gemelo.services.planner.collision.world import Positions, World
from gemelo.services.planner.native import compiled
from gemelo.services.planner.native.compiled import where_built
from gemelo.services.planner.request.deadline import CancelFlag, CountedTime

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]


class Stretch(NamedTuple):
    """The rows (m, n) of a polyline, and the names of the pairs that may touch on it; None for all pairs."""

    rows: Array
    pairs: frozenset[LinkPair] | None = None


class Resolution(NamedTuple):
    """Answer about a polyline: a configuration (n,) that surely touches, or the stretches that are left unresolved."""

    touching: Array | None = None
    unresolved: tuple[Stretch, ...] = ()


class SphereCheck(Protocol):
    """A fast check in a world, with `margin` [m] to keep; joint values are (n,) or (m, n) [rad] or [m]."""

    def planner(self, world: World, margin: float) -> NativePlanner | None:
        """The native planner in this world, to keep `margin` [m], or None if it is not built."""

    def least_distance(self, world: World, positions: Positions) -> float:
        """[m] that every pair is apart at least in this configuration (n,) [rad] or [m]; 0 where nothing is known."""

    def keeps(self, world: World, positions: Positions, margin: float) -> bool:
        """True if the one configuration (n,) [rad] or [m] is known to keep `margin` [m]."""

    def is_free(self, world: World, rows: Array, margin: float) -> bool:
        """True if the polyline through `rows` (m, n) [rad] or [m], m >= 2, is known to keep `margin` [m]."""

    def resolve(self, world: World, rows: Array, margin: float) -> Resolution:
        """What is certain of the polyline through `rows` (m, n) [rad] or [m], m >= 2, that is not known to be free,
        with `margin` [m] to keep."""


class NativeCheck:
    """By the native planner: spheres around the links of one arm."""

    def __init__(self, arm: ArmDescription) -> None:
        self._arm = arm
        self._shown: World | None = None

    def planner(self, world: World, margin: float) -> NativePlanner:
        """The native planner with the scene of `world`, to keep `margin` [m]."""
        planner = self._planner
        if self._shown is not world:
            show_scene(planner, world)
            self._shown = world
        planner.margin = margin
        return planner

    def least_distance(self, world: World, positions: Positions) -> float:
        """[m] between the spheres and what is nearest to them in this configuration (n,); 0 where they touch."""
        planner = self._planner if self._shown is world else self.planner(world, world.clearance)
        return planner.distance(positions)

    def keeps(self, world: World, positions: Positions, margin: float) -> bool:
        """True if the spheres keep `margin` [m] in the one configuration (n,) [rad] or [m]."""
        return self.planner(world, margin).is_free(positions)

    def is_free(self, world: World, rows: Array, margin: float) -> bool:
        """True if the spheres keep `margin` [m] all along the polyline through `rows` (m, n) [rad] or [m], m >= 2."""
        return self.planner(world, margin).path_free(rows)

    def resolve(self, world: World, rows: Array, margin: float) -> Resolution:
        """The result of the spheres for the polyline through `rows` (m, n) [rad] or [m] with `margin` [m] to keep, and
        the stretches that they leave unresolved."""
        planner = self.planner(world, margin)
        touching = planner.touching(rows)
        if touching is not None:
            return Resolution(touching)
        intervals = planner.unresolved_intervals(rows)
        return Resolution(
            unresolved=tuple(Stretch(rows_between(rows, each.begin, each.end), each.pairs) for each in intervals)
        )

    @cached_property
    def _planner(self) -> NativePlanner:
        """Takes a second the first time, in which spheres are fitted to the links."""
        return compiled.NativePlanner(self._arm)


class ExactShapesOnly:
    """Where the native planner is not built: nothing is known before coal looks."""

    def planner(self, world: World, margin: float) -> None:
        """None, whatever the margin [m]: there is no native planner."""
        return None

    def least_distance(self, world: World, positions: Positions) -> float:
        """0 for every configuration (n,) [rad] or [m]: nothing is known."""
        return 0.0

    def keeps(self, world: World, positions: Positions, margin: float) -> bool:
        """False, whatever the `positions` (n,) [rad] or [m] and the `margin` [m]: nothing is known."""
        return False

    def is_free(self, world: World, rows: Array, margin: float) -> bool:
        """False, whatever the `rows` (m, n) [rad] or [m] and the `margin` [m]: nothing is known."""
        return False

    def resolve(self, world: World, rows: Array, margin: float) -> Resolution:
        """The whole polyline through `rows` (m, n) [rad] or [m], unresolved."""
        return Resolution(unresolved=(Stretch(rows),))


@where_built(lambda _: ExactShapesOnly())
def sphere_check(arm: ArmDescription) -> SphereCheck:
    """The native planner's check where it is built, else the one that resolves nothing."""
    return NativeCheck(arm)


@where_built(threading.Event)
def cancel_flag() -> CancelFlag:
    """A flag that ends the native planner's search too, where that is built."""
    return compiled.CancelFlag()


class CountedInPython(threading.Event):
    """`CountedTime` where the native planner is not built."""

    def __init__(self, seconds_per_question: float) -> None:
        super().__init__()
        self._per_question, self._questions = seconds_per_question, 0

    def time(self, questions: int = 1) -> float:
        """[s] after so many more questions."""
        self._questions += questions
        return self._questions * self._per_question


@where_built(CountedInPython)
def counted_time(seconds_per_question: float) -> CountedTime:
    """A time [s] from 0 on, of `seconds_per_question` for each question, those of the native search among them."""
    return compiled.CancelFlag(seconds_per_question)


def show_scene(planner: NativePlanner, world: World) -> None:
    """Replaces what the planner is to keep clear of by the scene of `world`; raises ValueError for an unusable one."""
    obstacles, attachments = native_scene(world.arm, world.scene, world.folders)
    if planner.attached or attachments:
        planner.set_scene(())
    for name in planner.attached:
        planner.detach(name)
    for attachment in attachments:
        planner.attach(attachment)
    planner.set_scene(obstacles)


def rows_between(rows: Array, begin: float, end: float) -> Array:
    """The part (k, n) [rad] or [m] of the polyline through `rows` (m, n) from one fractional row number to another."""
    begin, end = max(begin, 0.0), min(end, len(rows) - 1.0)
    ends = [(1.0 - place % 1.0) * rows[int(place)] + place % 1.0 * rows[math.ceil(place)] for place in (begin, end)]
    return np.vstack((ends[0], rows[int(begin) + 1 : math.ceil(end)], ends[1]))
