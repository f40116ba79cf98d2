"""The planning scene and the planned path as markers of RViz (visualization_msgs/MarkerArray), each whole."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from gemelo.libraries.ros2.messages import duration_of, header_of, time_of
from gemelo.libraries.ros2.types import make
from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.scene import BoxShape, CylinderShape, PlaneShape, PlanningScene, SceneObject, SphereShape

MARKERS = "visualization_msgs/msg/MarkerArray"
CUBE, SPHERE, CYLINDER, LINE_STRIP = 1, 2, 3, 4  # kinds of a marker
ADD, DELETE_ALL = 0, 3
AROUND, CARRIED, PATH = (0.5, 0.5, 0.55, 0.8), (0.9, 0.6, 0.2, 0.9), (0.2, 0.7, 1.0, 1.0)  # red, green, blue, alpha
PLANE = (4.0, 4.0, 0.001)  # [m] what is drawn of one
LINE = 0.003  # [m] of the path
NO_SHAPE = (0.0, 0.0, 0.0)
STANDING = Transform()


def scene_markers(scene: PlanningScene, base: str, prefix: str = "") -> Any:
    """The objects in their frames, that of `base` where they name none; meshes are left out.

    `prefix` stands before the name of each frame.
    """
    found = [_deletion(scene.stamp)]
    for number, each in enumerate(scene.objects):
        kind, scale, pose = _shape(each)
        if kind is not None:
            color = CARRIED if each.attached else AROUND
            header = header_of(0, prefix + (each.frame or base))  # 0: wherever the frame is at the moment
            found.append(_marker(header, number, kind, scale, color, pose, name=each.name))
    return make(MARKERS, markers=found)


def path_markers(path: PlannedPath, base: str, prefix: str = "") -> Any:
    """The tool's planned path as a line; nothing where it has no points."""
    found = [_deletion(path.stamp)]
    if path.points:
        header = header_of(0, prefix + (path.frame or base))
        found.append(_marker(header, 0, LINE_STRIP, (LINE, 0.0, 0.0), PATH, STANDING, path.points, "planned path"))
    return make(MARKERS, markers=found)


def _shape(each: SceneObject) -> tuple[int | None, Vector, Transform]:
    """The kind of marker, its scale [m] and its pose."""
    match each.shape:
        case BoxShape(size=size):
            return CUBE, size, each.pose
        case SphereShape(radius=radius):
            return SPHERE, (2 * radius,) * 3, each.pose
        case CylinderShape(radius=radius, length=length):
            return CYLINDER, (2 * radius, 2 * radius, length), each.pose
        case PlaneShape():
            return CUBE, PLANE, each.pose
    return None, NO_SHAPE, each.pose


def _deletion(stamp: int) -> Any:
    """All that was drawn before goes."""
    return _marker(header_of(stamp), 0, CUBE, NO_SHAPE, AROUND, STANDING, action=DELETE_ALL)


def _marker(
    header: Any, number: int, kind: int, scale: Vector, color: Vector, pose: Transform,
    points: Iterable[Vector] = (), name: str = "", action: int = ADD,
) -> Any:  # fmt: skip
    """One marker; `scale` and `points` (3,) in [m], `color` a share of red, green, blue and alpha."""
    at, turned = pose.translation, pose.rotation
    return make(
        "visualization_msgs/msg/Marker",
        header=header,
        ns="gemelo",
        id=number,
        type=kind,
        action=action,
        pose=make(
            "geometry_msgs/msg/Pose",
            position=_of("geometry_msgs/msg/Point", "xyz", at),
            orientation=_of("geometry_msgs/msg/Quaternion", "xyzw", turned),
        ),
        scale=_of("geometry_msgs/msg/Vector3", "xyz", scale),
        color=_of("std_msgs/msg/ColorRGBA", "rgba", color),
        lifetime=duration_of(0.0),
        frame_locked=True,
        points=[_of("geometry_msgs/msg/Point", "xyz", each) for each in points],
        colors=[],
        texture_resource="",
        texture=make(
            "sensor_msgs/msg/CompressedImage",
            header=make("std_msgs/msg/Header", stamp=time_of(0), frame_id=""),
            format="",
            data=np.array([], np.uint8),
        ),
        uv_coordinates=[],
        text=name,
        mesh_resource="",
        mesh_file=make("visualization_msgs/msg/MeshFile", filename="", data=np.array([], np.uint8)),
        mesh_use_embedded_materials=False,
    )


def _of(kind: str, names: str, values: Vector) -> Any:
    return make(kind, **dict(zip(names, map(float, values), strict=True)))
