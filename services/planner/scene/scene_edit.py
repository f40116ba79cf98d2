"""One change of a planning scene, for each kind of `SceneEdit`. Pure; raises `SceneError`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_message, inverse, to_message
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import (
    AllowedPair,
    PlanningScene,
    SceneAdd,
    SceneAllow,
    SceneAttach,
    SceneClear,
    SceneDetach,
    SceneDisallow,
    SceneEdit,
    SceneGrip,
    SceneMove,
    SceneObject,
    SceneRelease,
    SceneRemove,
    SceneReplace,
    SceneResize,
)
from gemelo.services.planner.collision.scene_shapes import SceneError, pose_of
from gemelo.services.planner.scene.grasp import Grasp
from gemelo.services.planner.scene.scene_check import require_link

LinkPoses = Callable[
    [], Mapping[str, Transform] | None
]  # in the base, now; None while it is not known where the arm is

replace = msgspec.structs.replace


def edited(
    arm: ArmDescription, scene: PlanningScene, edit: SceneEdit, links: LinkPoses, grasp: Grasp | None = None
) -> PlanningScene:
    """The scene after the change, with the same version; `scene_check` says if it is valid. Raises `SceneError`.

    `grasp`: what stands between the jaws, for `SceneGrip`.
    """
    editor = SceneEditor(arm, scene, links)
    match edit:
        case SceneAdd(object=item):
            return editor.add(item)
        case SceneRemove(name=name):
            return editor.remove(name)
        case SceneMove():
            return editor.move(edit)
        case SceneResize(name=name, shape=shape):
            return editor.put(replace(editor.named(name), shape=shape))
        case SceneAttach():
            return editor.attach(edit)
        case SceneDetach(name=name):
            return editor.detach(name)
        case SceneGrip():
            return scene if edit.look or grasp is None else editor.grip(grasp.item)
        case SceneRelease():
            return editor.release()
        case SceneAllow(pair=pair):
            return editor.allow(pair)
        case SceneDisallow(pair=pair):
            return editor.disallow(pair)
        case SceneReplace(scene=other):
            return editor.replace_by(other)
        case SceneClear():
            return replace(scene, objects=(), allowed=())


class SceneEditor:
    """One scene and where the arm's links are, to be changed in one way or another."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene, links: LinkPoses) -> None:
        self._arm, self._scene, self._links = arm, scene, links

    def named(self, name: str) -> SceneObject:
        """The object of that name."""
        for item in self._scene.objects:
            if item.name == name:
                return item
        known = [item.name for item in self._scene.objects]
        raise SceneError(because("scene.object.unknown", nearest(name, known), object=name))

    def put(self, item: SceneObject) -> PlanningScene:
        """The object in the place of the one of its name, or as the last."""
        objects = tuple(item if old.name == item.name else old for old in self._scene.objects)
        known = any(old.name == item.name for old in self._scene.objects)
        return replace(self._scene, objects=objects if known else (*objects, item))

    def add(self, item: SceneObject) -> PlanningScene:
        """The scene with the object, in place of one of its name; raises `SceneError`."""
        return self.put(self._settled(item))

    def remove(self, name: str) -> PlanningScene:
        """Without the object, and without what was allowed to it."""
        gone = self.named(name)
        objects = tuple(item for item in self._scene.objects if item is not gone)
        allowed = tuple(pair for pair in self._scene.allowed if name not in (pair.first, pair.second))
        return replace(self._scene, objects=objects, allowed=allowed)

    def move(self, edit: SceneMove) -> PlanningScene:
        """The object at another pose; an attached object stays attached, elsewhere on its link."""
        item = self.named(edit.name)
        pose = pose_of(replace(item, pose=edit.pose))
        if not (item.attached and edit.frame == item.frame):
            pose = compose(self._frame(edit.frame, edit.name), pose)
            if item.attached:
                pose = compose(inverse(self._frame(item.frame, edit.name)), pose)
        return self.put(replace(item, pose=to_message(pose)))

    def attach(self, edit: SceneAttach) -> PlanningScene:
        """The object attached from where it is now, be that in the base or on another link."""
        item = self.named(edit.name)
        require_link(self._arm, edit.link, "scene.link.attach", edit.name)
        pose = to_message(compose(inverse(self._frame(edit.link, edit.name)), self._in_base(item)))
        return self.put(replace(item, pose=pose, frame=edit.link, attached=True, touch_links=edit.touch_links))

    def detach(self, name: str) -> PlanningScene:
        """The scene with the object standing in the base where it is now; raises `SceneError`."""
        item = self.named(name)
        if not item.attached:
            raise SceneError(because("scene.object.not_attached", object=name))
        pose = to_message(self._in_base(item))
        return self.put(replace(item, pose=pose, frame="", attached=False, touch_links=(), gripped=False))

    def grip(self, item: SceneObject) -> PlanningScene:
        """The object attached to the tool, which it and what holds the tool may touch."""
        holder = tuple(joint.parent for joint in self._arm.model.joints if joint.child == self._arm.tool_frame)
        held = SceneEditor(self._arm, self.attach(SceneAttach(name=item.name, link=self._arm.tool_frame)), self._links)
        return held.put(replace(held.named(item.name), touch_links=holder, gripped=True))

    def release(self) -> PlanningScene:
        """What was gripped stands where it is now."""
        scene = self._scene
        for item in self._scene.objects:
            if item.gripped:
                scene = SceneEditor(self._arm, scene, self._links).detach(item.name)
        return scene

    def allow(self, pair: AllowedPair) -> PlanningScene:
        """The scene with the pair allowed to touch."""
        if self._is_allowed(pair):
            return self._scene
        return replace(self._scene, allowed=(*self._scene.allowed, pair))

    def disallow(self, pair: AllowedPair) -> PlanningScene:
        """The scene without the allowed pair; raises `SceneError` if it was not allowed."""
        if not self._is_allowed(pair):
            named = {"first": pair.first, "second": pair.second}
            allowed = tuple(f"{old.first} / {old.second}" for old in self._scene.allowed)
            if not allowed:
                raise SceneError(because("scene.pair.none_allowed", **named))
            raise SceneError(because("scene.pair.not_allowed", **named, allowed=allowed))
        return replace(self._scene, allowed=tuple(old for old in self._scene.allowed if not _same(old, pair)))

    def replace_by(self, scene: PlanningScene) -> PlanningScene:
        """The objects and allowed pairs of another scene; raises `SceneError`."""
        objects = tuple(self._settled(item) for item in scene.objects)
        return replace(self._scene, objects=objects, allowed=scene.allowed)

    def _is_allowed(self, pair: AllowedPair) -> bool:
        return any(_same(old, pair) for old in self._scene.allowed)

    def _settled(self, item: SceneObject) -> SceneObject:
        """What is not attached stands still from now on: in the base, wherever its frame is at present."""
        if item.attached or not item.frame:
            return item
        return replace(item, pose=to_message(self._in_base(item)), frame="")

    def _in_base(self, item: SceneObject) -> Rigid:
        return compose(self._frame(item.frame, item.name), pose_of(item))

    def _frame(self, frame: str, name: str) -> Rigid:
        """Where a frame is in the base now."""
        if frame in ("", self._arm.base_frame):
            return IDENTITY
        require_link(self._arm, frame, "scene.link.place", name)
        poses = self._links()
        if poses is None:
            would_do = remedy("start_gateway"), remedy("pose_in_base")
            raise SceneError(because("scene.object.placed_by", *would_do, object=name, link=frame))
        return from_message(poses[frame])


def _same(one: AllowedPair, other: AllowedPair) -> bool:
    return {one.first, one.second} == {other.first, other.second}
