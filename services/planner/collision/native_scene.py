"""A planning scene as the native planner has it: obstacles in the base frame, and what the links carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.scene import PlanningScene, SceneObject
from gemelo.services.planner.collision.scene_shapes import allows, shape_of
from gemelo.services.planner.collision_geometry.shapes import Attachment, CollisionShape


def native_scene(
    arm: ArmDescription, scene: PlanningScene, folders: Sequence[Path] = ()
) -> tuple[list[CollisionShape], list[Attachment]]:
    """Obstacles and attachments with what they may touch; raises `SceneError`. What may touch is as in `World`."""
    links = [link.name for link in arm.model.links if link.collisions]
    carried = [_attachment(item, scene, links, folders) for item in scene.objects if item.attached]
    names = [*links, *(item.name for item in carried)]
    may_touch = bool(scene.allowed or carried)
    around = [
        _obstacle(item, _touching(item, scene, names) if may_touch else frozenset(), folders)
        for item in scene.objects
        if not item.attached
    ]
    return around, carried


def _obstacle(item: SceneObject, touching: frozenset[str], folders: Sequence[Path]) -> CollisionShape:
    shape = shape_of(item, folders)
    return replace(shape, touching=touching) if touching else shape


def _attachment(item: SceneObject, scene: PlanningScene, links: list[str], folders: Sequence[Path]) -> Attachment:
    others = [other.name for other in scene.objects if other.attached and other.name != item.name]
    allowed = {name for name in (*links, *others) if allows(scene.allowed, name, item.name)}
    return Attachment(
        item.name, item.frame, (shape_of(item, folders),), frozenset(allowed | {item.frame, *item.touch_links})
    )


def _touching(item: SceneObject, scene: PlanningScene, names: list[str]) -> frozenset[str]:
    """What is allowed to, and attached objects whose touch links name this one."""
    holders = {held.name for held in scene.objects if held.attached and item.name in held.touch_links}
    return frozenset(name for name in names if name in holders or allows(scene.allowed, name, item.name))
