"""URDF and planning scene as a MuJoCo model, read here anew, so that nothing of the planner's reading is believed.

MuJoCo sees convex solids only: a drawn link is its parts, which are convex, and an STL mesh of the scene is the
tetrahedra from its middle to its triangles, which asks for one that is seen whole from there.
"""

from __future__ import annotations

import io
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import trimesh
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, PlanningScene, SceneObject, SphereShape

Array = NDArray[np.float64]
Numbers = list[float]

SOLIDS = {"box": mujoco.mjtGeom.mjGEOM_BOX, "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER}


class MujocoArm:
    """The compiled model; `owners` and `paddings` [m] say of each geom which link or object it is part of."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene, is_drawn: bool) -> None:
        """`is_drawn`: the links are the meshes that are shown, in convex pieces, and not their collision shapes."""
        self._spec = mujoco.MjSpec()
        self._spec.option.ccd_iterations, self._spec.option.ccd_tolerance = 500, 1e-9
        self._spec.compiler.boundmass = self._spec.compiler.boundinertia = 1e-3
        self._folder, self._is_drawn = arm.folder, is_drawn
        self._labels: list[tuple[str, float]] = []
        self._root = ET.parse(arm.urdf_path).getroot()
        self._add_links(self._spec.worldbody, self._first_link(), None)
        for item in scene.objects:
            self._add_object(item, arm.base_frame)
        self.model = self._spec.compile()
        labels = [self._labels[int(self.model.geom(index).name)] for index in range(self.model.ngeom)]
        self.owners = [owner for owner, _ in labels]
        self.paddings = [padding for _, padding in labels]

    def _first_link(self) -> str:
        children = {joint.find("child").get("link") for joint in self._root.findall("joint")}
        (first,) = {link.get("name") for link in self._root.findall("link")} - children
        return first

    def _add_links(self, parent: mujoco.MjsBody, link: str, joint: ET.Element | None) -> None:
        place, turn = _pose(joint)
        body = parent.add_body(name=link, pos=place, quat=turn)
        if joint is not None and joint.get("type") != "fixed":
            assert joint.find("mimic") is None, "a mimic joint is not known here"
            kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.get("type") == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=joint.get("name"), type=kind, axis=_numbers(joint.find("axis").get("xyz")))
        element = next(one for one in self._root.findall("link") if one.get("name") == link)
        for shape in element.findall("visual" if self._is_drawn else "collision"):
            self._add_shape(body, link, shape)
        for below in self._root.findall("joint"):
            if below.find("parent").get("link") == link:
                self._add_links(body, below.find("child").get("link"), below)

    def _add_shape(self, body: mujoco.MjsBody, link: str, shape: ET.Element) -> None:
        (form,) = shape.find("geometry")
        place, turn = _pose(shape)
        if form.tag == "mesh":
            for piece in _pieces(self._folder / form.get("filename")):
                self._add_mesh(body, link, piece, place, turn)
        elif form.tag == "sphere":
            self._add_geom(body, link, mujoco.mjtGeom.mjGEOM_SPHERE, [float(form.get("radius"))], place, turn)
        elif form.tag == "cylinder":
            size = [float(form.get("radius")), 0.5 * float(form.get("length"))]
            self._add_geom(body, link, SOLIDS["cylinder"], size, place, turn)
        else:
            size = [0.5 * edge for edge in _numbers(form.get("size"))]
            self._add_geom(body, link, SOLIDS[form.tag], size, place, turn)

    def _add_object(self, item: SceneObject, base: str) -> None:
        body = self._spec.body(item.frame if item.attached else base)
        x, y, z, w = item.pose.rotation
        place, turn = list(item.pose.translation), [w, x, y, z]
        match item.shape:
            case BoxShape(size=size):
                self._add_geom(body, item.name, SOLIDS["box"], [0.5 * edge for edge in size], place, turn, item.padding)
            case SphereShape(radius=radius):
                kind = mujoco.mjtGeom.mjGEOM_SPHERE
                self._add_geom(body, item.name, kind, [radius], place, turn, item.padding)
            case CylinderShape(radius=radius, length=length):
                size = [radius, 0.5 * length]
                self._add_geom(body, item.name, SOLIDS["cylinder"], size, place, turn, item.padding)
            case PlaneShape():
                self._add_geom(body, item.name, mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0], place, turn, item.padding)
            case MeshShape():
                for piece in _fan(item.shape):
                    self._add_mesh(body, item.name, piece, place, turn, item.padding)

    def _add_mesh(
        self, body: mujoco.MjsBody, owner: str, corners: Array, place: Numbers, turn: Numbers, padding: float = 0.0
    ) -> None:
        """The convex hull of `corners` (v, 3) [m], which is all that MuJoCo sees of a mesh."""
        name = f"piece {len(self._labels)}"
        self._spec.add_mesh(name=name, uservert=corners.reshape(-1).tolist())
        geom = self._add_geom(body, owner, mujoco.mjtGeom.mjGEOM_MESH, [], place, turn, padding)
        geom.meshname = name

    def _add_geom(
        self,
        body: mujoco.MjsBody,
        owner: str,
        kind: mujoco.mjtGeom,
        size: Numbers,
        place: Numbers,
        turn: Numbers,
        padding: float = 0.0,
    ) -> mujoco.MjsGeom:
        self._labels.append((owner, padding))
        whole = [*size, 0.0, 0.0, 0.0][:3]
        return body.add_geom(name=str(len(self._labels) - 1), type=kind, size=whole, pos=place, quat=turn)


def _numbers(text: str) -> Numbers:
    return [float(word) for word in text.split()]


def _pose(element: ET.Element | None) -> tuple[Numbers, Numbers]:
    """Place [m] and quaternion (w, x, y, z) of an <origin>, by MuJoCo's own reading of its fixed axes."""
    origin = None if element is None else element.find("origin")
    turn = np.zeros(4)
    mujoco.mju_euler2Quat(turn, _numbers("0 0 0" if origin is None else origin.get("rpy", "0 0 0")), "XYZ")
    return _numbers("0 0 0" if origin is None else origin.get("xyz", "0 0 0")), turn.tolist()


def _pieces(path: Path) -> list[Array]:
    """The drawn link's parts, each of which is convex."""
    mesh = trimesh.load(path, force="mesh")
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [np.asarray(part.vertices) for part in plain.split(only_watertight=False)]


def _fan(shape: MeshShape) -> list[Array]:
    """A solid as the tetrahedra from its middle to its triangles; for meshes that are seen whole from there."""
    mesh = trimesh.load(io.BytesIO(shape.data), file_type="stl")
    corners = np.asarray(mesh.triangles) * np.array(shape.scale)
    middle = corners.reshape(-1, 3).mean(axis=0)
    volumes = np.einsum("ij,ij->i", corners[:, 0] - middle, np.cross(corners[:, 1] - middle, corners[:, 2] - middle))
    assert volumes.min() > 0.0 or volumes.max() < 0.0, "the mesh is not seen whole from its middle"
    return [np.vstack((three, middle)) for three in corners]
