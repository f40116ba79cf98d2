"""The native planner as the sphere check of collisions, and the scene of a world as it has it; none where it is not
built."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.pair_tables import pair_tables
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.native import compiled
from gemelo.services.planner.native.compiled import where_built
from gemelo.services.planner.request.deadline import CancelFlag, CountedTime

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner
from collections.abc import Sequence
from dataclasses import replace

from gemelo.schemas.scene import PlanningScene, SceneObject
from gemelo.services.planner.collision.scene_shapes import allows, shape_of
from gemelo.services.planner.collision_geometry.shapes import Attachment, CollisionShape

Array = NDArray[np.float64]


@where_built(lambda _: None)
def native_planner(arm: ArmDescription) -> NativePlanner | None:
    """The native planner of an arm, in a second, in which spheres are fitted to its links, and coal is asked about
    links that are always near; None where it is not built."""
    planner = compiled.NativePlanner(arm)
    planner.set_tables(pair_tables(arm, planner))
    return planner


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
    obstacles, attachments = native_scene(world.arm, world.scene, world.shapes)
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


def native_scene(
    arm: ArmDescription, scene: PlanningScene, shapes: Sequence[CollisionShape] | None = None
) -> tuple[list[CollisionShape], list[Attachment]]:
    """Obstacles and attachments with what they may touch, of objects whose `shapes` these are; raises `SceneError`.
    What may touch is as in `World`."""
    solids = [shape_of(item) for item in scene.objects] if shapes is None else shapes
    carried = [item for item in scene.objects if item.attached]
    if not carried and not scene.allowed:
        return list(solids), []
    links = [link.name for link in arm.model.links if link.collisions]
    names = [*links, *(item.name for item in carried)]
    around, attachments = list[CollisionShape](), list[Attachment]()
    for item, shape in zip(scene.objects, solids, strict=True):
        if item.attached:
            attachments.append(_attachment(item, shape, scene, links))
        else:
            touching = _touching(item, scene, names)
            around.append(replace(shape, touching=touching) if touching else shape)
    return around, attachments


def _attachment(item: SceneObject, shape: CollisionShape, scene: PlanningScene, links: list[str]) -> Attachment:
    others = [other.name for other in scene.objects if other.attached and other.name != item.name]
    allowed = {name for name in (*links, *others) if allows(scene.allowed, name, item.name)}
    return Attachment(item.name, item.frame, (shape,), frozenset(allowed | {item.frame, *item.touch_links}))


def _touching(item: SceneObject, scene: PlanningScene, names: list[str]) -> frozenset[str]:
    """What is allowed to, and attached objects whose touch links name this one."""
    holders = {held.name for held in scene.objects if held.attached and item.name in held.touch_links}
    return frozenset(name for name in names if name in holders or allows(scene.allowed, name, item.name))
