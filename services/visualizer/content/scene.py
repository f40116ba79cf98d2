"""The planning scene as it is drawn: objects, attached objects, and in red the contacts of a refused plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gemelo.schemas.message import Vector
from gemelo.schemas.scene import (
    BoxShape,
    Contacts,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    SphereShape,
)
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.content.arm_poses import arm_pose_at
from gemelo.services.visualizer.content.event_log import clamp_stamp
from gemelo.services.visualizer.content.updates import ClearEntity, Labels, SolidMesh, TranslucentArm, Update
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh, primitive_mesh
from gemelo.services.visualizer.model.visual_model import VisualModel, VisualShape

PLANE = VisualShape("box", (2.0, 2.0, 0.004))  # [m] as much of a plane as is drawn
MeshLoader = Callable[[MeshShape], ShadedMesh | None]


def load_no_mesh(shape: MeshShape) -> None:
    """For a view that has no files."""


@dataclass(frozen=True)
class DrawnObject:
    """One object where and how it was shown last."""

    item: SceneObject
    entity: str
    color: palette.Rgba


class SceneView:
    """The newest scene and contacts, told anew only where they changed; `load` reads mesh files, or gives None."""

    def __init__(self, model: VisualModel, load: MeshLoader) -> None:
        self._model, self._load = model, load
        self._scene, self._contacts = PlanningScene(), Contacts()
        self._jaws: tuple[SceneObject, ...] = ()
        self._drawn: dict[str, DrawnObject] = {}
        self._meshes: dict[MeshShape, ShadedMesh | None] = {}
        self._is_new = False

    def on_scene(self, message: PlanningScene) -> None:
        """The planning scene: objects and attached objects; a mesh without its file is drawn when that comes."""
        self._scene, self._is_new = message, True
        shapes = {item.shape for item in message.objects if isinstance(item.shape, MeshShape)}
        self._meshes = {shape: mesh for shape, mesh in self._meshes.items() if shape in shapes}

    def on_jaws(self, jaws: tuple[SceneObject, ...]) -> None:
        """The gripper's jaws, as far apart as they are."""
        self._is_new = self._is_new or jaws != self._jaws
        self._jaws = jaws

    def on_contacts(self, message: Contacts) -> None:
        """The contacts of the configuration that was refused last."""
        self._contacts, self._is_new = message, True

    def on_motion(self) -> None:
        """The real arm goes: a configuration that was refused is of the past."""
        if self._contacts.contacts:
            self._contacts, self._is_new = Contacts(), True

    def restart(self) -> None:
        """Say everything again: the viewer is a new one."""
        self._drawn, self._is_new = {}, True

    def take(self, now: int) -> list[Update]:
        """The updates since the last call; `now` in [ns] UNIX."""
        if not self._is_new:
            return []
        self._is_new = False
        now = clamp_stamp(now)
        wanted = {item.name: self._wanted(item) for item in self._items if self._has_place(item)}
        updates: list[Update] = []
        for name, old in self._drawn.items():
            if name not in wanted or wanted[name].entity != old.entity:
                updates.append(ClearEntity(old.entity, now))
        for name, new in wanted.items():
            if self._drawn.get(name) != new:
                updates += self._solid_mesh(new.item, new.entity, new.color, now)
        self._drawn = wanted
        return [*updates, *self._refused(now)]

    @property
    def _items(self) -> tuple[SceneObject, ...]:
        return (*self._scene.objects, *self._jaws)

    def _has_place(self, item: SceneObject) -> bool:
        return not item.attached or item.frame in self._model.paths

    def _wanted(self, item: SceneObject) -> DrawnObject:
        root = entities.attached(entities.MEASURED, self._model.paths[item.frame]) if item.attached else entities.SCENE
        color = palette.ATTACHED if item.attached else palette.OBJECT
        # An attached object is in contact in the refused configuration, and drawn red there; here it follows the arm.
        is_red = item.name in self._in_contact() and not item.attached
        return DrawnObject(item, f"{root}/{entities.part(item.name)}", palette.IN_CONTACT if is_red else color)

    def _in_contact(self) -> frozenset[str]:
        return frozenset(name for contact in self._contacts.contacts for name in (contact.first, contact.second))

    def _solid_mesh(self, item: SceneObject, entity: str, color: palette.Rgba, now: int) -> list[Update]:
        mesh = self._mesh(item)
        if mesh is None or len(item.pose.translation) != 3 or len(item.pose.rotation) != 4:
            return []
        return [SolidMesh(entity, now, mesh, item.pose.translation, item.pose.rotation, color)]

    def _refused(self, now: int) -> list[Update]:
        """The arm in the refused configuration, with what touches in red and named; nothing once nothing does."""
        # A nanosecond before: Rerun forgets a pose that is told at the very time of a clearing, told later or not.
        updates: list[Update] = [ClearEntity(entities.REFUSED, now - 1)]
        configuration = dict(zip(self._contacts.name, self._contacts.position, strict=False))
        names = [joint.name for joint in self._model.moving]
        if not self._contacts.contacts or any(name not in configuration for name in names):
            return updates
        touching = self._in_contact()
        updates.append(TranslucentArm(entities.REFUSED, now, touching, palette.REFUSED_ARM))
        updates += arm_pose_at(self._model, entities.REFUSED, now, np.array([configuration[name] for name in names]))
        updates += self.attached(entities.REFUSED, palette.REFUSED_ARM, now)
        return [*updates, *self._labels(now)]

    def attached(self, root: str, color: palette.Rgba, now: int) -> list[Update]:
        """What the arm carries, in the hand of another arm under `root`; what touches in a refused configuration is
        red."""
        red = self._in_contact() if root == entities.REFUSED else frozenset()
        updates: list[Update] = []
        for item in self._items:
            if item.attached and self._has_place(item):
                hand = entities.attached(root, self._model.paths[item.frame])
                shown = palette.IN_CONTACT if item.name in red else color
                updates += self._solid_mesh(item, f"{hand}/{entities.part(item.name)}", shown, now)
        return updates

    def _labels(self, now: int) -> list[Update]:
        """A dot for each pair, and all their names at the nearest: several labels would hide one another."""
        placed = [contact for contact in self._contacts.contacts if len(contact.point) == 3]
        if not placed:
            return []
        lines = [f"{each.first} and {each.second}: {_gap(each.distance)}" for each in placed]
        points = np.array([contact.point for contact in placed], dtype=float)
        return [Labels(entities.CONTACTS, now, points, ("\n".join(lines), *("" for _ in lines[1:])))]

    def _mesh(self, item: SceneObject) -> ShadedMesh | None:
        match item.shape:
            case BoxShape(size=size) if len(size) == 3:
                return primitive_mesh(VisualShape("box", size), item.padding)
            case SphereShape(radius=radius):
                return primitive_mesh(VisualShape("sphere", (radius,)), item.padding)
            case CylinderShape(radius=radius, length=length):
                return primitive_mesh(VisualShape("cylinder", (radius, length)), item.padding)
            case PlaneShape():
                return _below(primitive_mesh(PLANE), item.padding)
            case MeshShape(path="", data=b"", digest=digest) if digest:
                return None
            case MeshShape():
                return self._loaded(item.shape)
        return None

    def _loaded(self, shape: MeshShape) -> ShadedMesh | None:
        """Each file is read once."""
        if shape not in self._meshes:
            self._meshes[shape] = self._load(shape)
        return self._meshes[shape]


def _gap(distance: float) -> str:
    """[m] in words: a minus sign between two names would be read as a dash."""
    return f"{1000.0 * distance:.1f} mm apart" if distance > 0.0 else f"{-1000.0 * distance:z.1f} mm inside one another"


def _below(mesh: ShadedMesh, padding: float) -> ShadedMesh:
    """Its upper face at z = `padding` [m]."""
    down: Vector = (0.0, 0.0, padding - float(mesh.vertices[:, 2].max()))
    return ShadedMesh(mesh.vertices + down, mesh.normals, mesh.triangles)
