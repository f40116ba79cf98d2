"""Validation of planning scenes: names that mean one thing, links that exist, shapes that have a size."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.reasons import Reason, because, remedy
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
        count = len(scene.objects)
        raise SceneError(because("scene.objects.too_many", remedy("merge_objects"), count=count, limit=MOST_OBJECTS))
    size = sum(len(content) for content in meshes_in(scene).values())
    if size > LARGEST_MESHES:
        would_do = remedy("fewer_meshes")
        raise SceneError(because("scene.meshes.too_large", would_do, size=size, limit=LARGEST_MESHES))
    names = [item.name for item in scene.objects]
    for item in scene.objects:
        if names.count(item.name) > 1:
            raise SceneError(because("scene.object.twice", remedy("other_name_for_one"), object=item.name))
        require_object(arm, item, folders)
    for pair in scene.allowed:
        require_pair(arm, pair, names)


def require_object(arm: ArmDescription, item: SceneObject, folders: Folders) -> None:
    """Raises `SceneError` for a name, link, shape, pose or padding that cannot be."""
    _require_name(arm, item.name)
    shape_of(item, folders)
    if not item.attached:
        if item.frame:
            raise SceneError(because("scene.object.frame", object=item.name, link=item.frame))
        return
    if isinstance(item.shape, PlaneShape):
        raise SceneError(because("scene.object.plane", remedy("make_box"), object=item.name))
    require_link(arm, item.frame, "scene.link.attach", item.name)
    for link in item.touch_links:
        require_link(arm, link, "scene.link.touch", item.name)


def require_link(arm: ArmDescription, link: str, code: str, name: str) -> None:
    """Raises `SceneError` with the reason `code` of the object `name` for a link that the arm does not have."""
    links = arm.model.link_names
    if link not in links:
        raise SceneError(because(code, nearest(link, links), object=name, robot=arm.name, link=link))


def require_pair(arm: ArmDescription, pair: AllowedPair, objects: Iterable[str]) -> None:
    """Raises `SceneError` for a pair whose names mean nothing, or that allows everything."""
    if pair.first == pair.second:
        if pair.first == ANY:
            raise SceneError(because("scene.pair.everything", remedy("two_things")))
        raise SceneError(because("scene.pair.itself", remedy("two_things"), name=pair.first))
    known = [*arm.model.link_names, *objects, *(JAWS if arm.gripper is not None else ())]
    for name in (pair.first, pair.second):
        if name != ANY and name not in known:
            raise SceneError(because("scene.pair.unknown", nearest(name, known), name=name))


def _require_name(arm: ArmDescription, name: str) -> None:
    if not name or name != name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        would_do = remedy("printable_name", limit=LONGEST_NAME)
        raise SceneError(because("scene.name.bad", would_do, name=name[:LONGEST_NAME]))
    if name == ANY:
        raise SceneError(because("scene.name.any", remedy("other_name")))
    if name in JAWS:
        raise SceneError(because("scene.name.jaw", remedy("other_name"), name=name))
    if name in arm.model.link_names:
        raise SceneError(because("scene.name.link", remedy("other_name"), name=name, robot=arm.name))


def usable_part(arm: ArmDescription, scene: PlanningScene, folders: Folders) -> tuple[PlanningScene, list[Reason]]:
    """The scene without what cannot be, and why each of that cannot."""
    kept: dict[str, SceneObject] = {}
    pairs: list[AllowedPair] = []
    reasons: list[Reason] = []
    for item in scene.objects[:MOST_OBJECTS]:
        try:
            require_object(arm, item, folders)
            kept[item.name] = item
        except SceneError as error:
            reasons.append(error.reason)
    for pair in scene.allowed:
        try:
            require_pair(arm, pair, kept)
            pairs.append(pair)
        except SceneError as error:
            reasons.append(error.reason)
    return msgspec.structs.replace(scene, objects=tuple(kept.values()), allowed=tuple(pairs)), reasons
