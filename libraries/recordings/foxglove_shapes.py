"""The primitives that Foxglove draws of a robot's links and of the scene's objects. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.urdf import SIZES, Geometry, UrdfLink, urdf_of
from gemelo.libraries.recordings import foxglove_schemas as fox
from gemelo.schemas.reasons import because
from gemelo.schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, SceneObject, Shape, SphereShape

LINK = fox.Color(r=0.85, g=0.85, b=0.87, a=1.0)
OBJECT = fox.Color(r=0.35, g=0.55, b=0.85, a=0.7)
CARRIED = fox.Color(r=0.9, g=0.6, b=0.2, a=0.9)
PLANE = (4.0, 4.0, 0.002)  # [m] drawn of a plane, which has no end
MAX_TRIANGLES = 5000  # of an object that is a mesh: each is 150 bytes of JSON


@dataclass(frozen=True)
class Drawn:
    """The primitives of one link or object, in the frame that they move with."""

    frame: str
    cubes: tuple[fox.CubePrimitive, ...] = ()
    spheres: tuple[fox.SpherePrimitive, ...] = ()
    cylinders: tuple[fox.CylinderPrimitive, ...] = ()
    triangles: tuple[fox.TriangleListPrimitive, ...] = ()


def drawn_links(urdf: str) -> tuple[str, list[Drawn]]:
    """The root link of a URDF's text, and its links: visual shapes where they are primitives, else those of collision.

    Meshes are not drawn: their files are not in the recording, and Foxglove turns some kinds of them upright. What
    cannot be read of the URDF is left out.
    """
    try:
        robot, _ = urdf_of(urdf)
    except DescriptionError:
        return "", []
    children = {joint.child for joint in robot.joints}
    roots = [name for name in robot.link_names if name not in children]
    found = [_link(link) for link in robot.links]
    return (roots[0] if roots else ""), [each for each in found if each.cubes or each.spheres or each.cylinders]


def drawn_object(item: SceneObject, base: str) -> Drawn | None:
    """An object of the scene; None where its shape or pose cannot be drawn, or its mesh is in a file elsewhere."""
    color = CARRIED if item.attached else OBJECT
    try:
        pose = pose_of(item.pose.translation, item.pose.rotation)
        return _drawn_shape(item.frame or base, item.shape, pose, color)
    except ValueError:
        return None


def pose_of(translation: Sequence[float], rotation: Sequence[float]) -> fox.Pose:
    """(3,) [m] and a quaternion (x, y, z, w); raises ValueError for another number of values."""
    x, y, z, w = rotation
    return fox.Pose(position=_vector(translation), orientation=fox.Quaternion(x=x, y=y, z=z, w=w))


def _drawn_shape(frame: str, shape: Shape, pose: fox.Pose, color: fox.Color) -> Drawn | None:
    match shape:
        case BoxShape(size=size):
            return Drawn(frame, cubes=(fox.CubePrimitive(pose=pose, size=_vector(size), color=color),))
        case PlaneShape():
            return Drawn(frame, cubes=(fox.CubePrimitive(pose=pose, size=_vector(PLANE), color=color),))
        case SphereShape(radius=radius):
            return Drawn(frame, spheres=(_sphere(pose, radius, color),))
        case CylinderShape(radius=radius, length=length):
            return Drawn(frame, cylinders=(_cylinder(pose, radius, length, color),))
        case MeshShape(data=data, scale=scale) if data:
            return Drawn(frame, triangles=(_triangles(pose, data, scale, color),))
    return None


def _link(link: UrdfLink) -> Drawn:
    cubes, spheres, cylinders = [], [], []
    for each in _primitives(link.visuals) or _primitives(link.collisions):
        pose = pose_of(each.origin.xyz, from_rpy(*each.origin.rpy))
        if each.shape == "box":
            cubes.append(fox.CubePrimitive(pose=pose, size=_vector(each.size), color=LINK))
        elif each.shape == "sphere":
            spheres.append(_sphere(pose, each.size[0], LINK))
        else:
            cylinders.append(_cylinder(pose, each.size[0], each.size[1], LINK))
    return Drawn(link.name, tuple(cubes), tuple(spheres), tuple(cylinders))


def _primitives(shapes: Iterable[Geometry]) -> list[Geometry]:
    """Those that are no mesh, with all their sizes."""
    return [each for each in shapes if each.size and len(each.size) == sum(SIZES[each.shape].values())]


def _sphere(pose: fox.Pose, radius: float, color: fox.Color) -> fox.SpherePrimitive:
    return fox.SpherePrimitive(pose=pose, size=_vector((2 * radius,) * 3), color=color)


def _cylinder(pose: fox.Pose, radius: float, length: float, color: fox.Color) -> fox.CylinderPrimitive:
    size = _vector((2 * radius, 2 * radius, length))
    return fox.CylinderPrimitive(pose=pose, size=size, bottom_scale=1.0, top_scale=1.0, color=color)


def _triangles(pose: fox.Pose, data: bytes, scale: Sequence[float], color: fox.Color) -> fox.TriangleListPrimitive:
    from gemelo.libraries.arm.stl import BadStl, read_stl  # slow to load: numpy, for a scene with meshes alone

    mesh = read_stl(data)
    if len(mesh.faces) > MAX_TRIANGLES:
        raise BadStl(because("stl.too_many_to_draw", count=len(mesh.faces)))
    corners = (mesh.vertices * scale)[mesh.faces.reshape(-1)]
    return fox.TriangleListPrimitive(pose=pose, points=tuple(_vector(row) for row in corners.tolist()), color=color)


def _vector(values: Sequence[float]) -> fox.Vector3:
    x, y, z = values
    return fox.Vector3(x=x, y=y, z=z)
