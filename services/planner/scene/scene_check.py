"""Validation of planning scenes: names that mean one thing, links that exist, shapes that have a size."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.scene import AllowedPair, PlaneShape, PlanningScene, SceneObject
from gemelo.schemas.scene_meshes import meshes_in
from gemelo.services.planner.collision.scene_shapes import ANY, Folders, SceneError, shape_of

# Tuning constants: chosen, where a line does not say measured or standard.
LONGEST_NAME = 64  # chosen: fits into a line of a table and of a refusal
LARGEST_MESHES = 128_000_000  # [bytes] of the files of all meshes; chosen: the planner and its processes each have them
MOST_OBJECTS = 1000  # chosen: more than a cell has; a plan stays fast among so many


def require_scene(arm: ArmDescription, scene: PlanningScene, folders: Folders) -> None:
    """Raises `SceneError` for the first thing that cannot be."""
    if len(scene.objects) > MOST_OBJECTS:
        raise SceneError(
            f"the scene has {len(scene.objects)} objects, more than {MOST_OBJECTS}: merge some into meshes"
        )
    size = sum(len(content) for content in meshes_in(scene).values())
    if size > LARGEST_MESHES:
        raise SceneError(
            f"the meshes of the scene have {size} bytes, more than {LARGEST_MESHES}: simplify or remove some"
        )
    names = [item.name for item in scene.objects]
    for item in scene.objects:
        if names.count(item.name) > 1:
            raise SceneError(f'the scene has two objects "{item.name}"; give one of them another name')
        require_object(arm, item, folders)
    for pair in scene.allowed:
        require_pair(arm, pair, names)


def require_object(arm: ArmDescription, item: SceneObject, folders: Folders) -> None:
    """Raises `SceneError` for a name, link, shape, pose or padding that cannot be."""
    _require_name(arm, item.name)
    shape_of(item, folders)
    if not item.attached:
        if item.frame:
            raise SceneError(f'object "{item.name}" stands in "{item.frame}" without being attached to it')
        return
    if isinstance(item.shape, PlaneShape):
        raise SceneError(f'object "{item.name}" is a plane, which has no end and cannot be carried; make it a box')
    require_link(arm, item.frame, f'object "{item.name}" cannot be attached')
    for link in item.touch_links:
        require_link(arm, link, f'object "{item.name}" cannot touch it')


def require_link(arm: ArmDescription, link: str, why: str) -> None:
    """Raises `SceneError` for a link that the arm does not have."""
    if link not in arm.model.link_names:
        raise SceneError(f'{why}: {arm.name} has no link "{link}"{suggestion(link, arm.model.link_names)}')


def require_pair(arm: ArmDescription, pair: AllowedPair, objects: Iterable[str]) -> None:
    """Raises `SceneError` for a pair whose names mean nothing, or that allows everything."""
    if pair.first == pair.second:
        what = "everything to touch everything" if pair.first == ANY else f'"{pair.first}" to touch itself'
        raise SceneError(f'the pair "{pair.first}" and "{pair.second}" allows {what}; name two different things')
    known = [*arm.model.link_names, *objects, *(JAWS if arm.gripper is not None else ())]
    for name in (pair.first, pair.second):
        if name != ANY and name not in known:
            raise SceneError(f'there is no link or object "{name}"{suggestion(name, known)}')


def _require_name(arm: ArmDescription, name: str) -> None:
    if not name or name != name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        raise SceneError(
            f'"{name[:LONGEST_NAME]}" is no name for an object; give 1 to {LONGEST_NAME} printable characters without '
            "blanks at the ends"
        )
    if name == ANY:
        raise SceneError('"*" stands for any name and cannot be an object\'s; give it another one')
    if name in JAWS:
        raise SceneError(f'"{name}" is a jaw of the gripper; give the object another name')
    if name in arm.model.link_names:
        raise SceneError(f'"{name}" is a link of {arm.name}; give the object another name')


def usable_part(arm: ArmDescription, scene: PlanningScene, folders: Folders) -> tuple[PlanningScene, list[str]]:
    """The scene without what cannot be, and why each of that cannot."""
    kept: dict[str, SceneObject] = {}
    pairs: list[AllowedPair] = []
    reasons: list[str] = []
    for item in scene.objects[:MOST_OBJECTS]:
        try:
            require_object(arm, item, folders)
            kept[item.name] = item
        except SceneError as error:
            reasons.append(str(error))
    for pair in scene.allowed:
        try:
            require_pair(arm, pair, kept)
            pairs.append(pair)
        except SceneError as error:
            reasons.append(str(error))
    return msgspec.structs.replace(scene, objects=tuple(kept.values()), allowed=tuple(pairs)), reasons
