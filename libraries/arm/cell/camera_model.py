"""Cameras of a cell as the messages that describe them: exactly, or as far as they were measured."""

from __future__ import annotations

import math

from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.libraries.arm.frames.transforms import Quaternion, Rigid, from_axis_angle, multiply, to_message
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import CameraRecord, Point, VirtualSource

ALONG = 0.999  # cosine from which a camera looks along the parent's z


def believed_info(cell: Cell, record: CameraRecord, base_frame: str) -> CameraInfo:
    """What is known of a camera: measured where camera.toml says so, else exact if virtual, else assumed."""
    info = exact_info(record, base_frame)
    is_virtual = isinstance(record.source, VirtualSource)
    known = cell.measured.get(record.name)
    lens = known.calibration if known else None
    mount = known.mount if known else None
    values: dict[str, object] = {"is_calibrated": is_virtual or lens is not None}
    values |= {"is_mounted": is_virtual or mount is not None}
    if lens is not None:
        values |= {"intrinsics": scaled(lens.intrinsics, lens.size, record.size)}
        values |= {"distortion": lens.distortion, "date": lens.date}
    if mount is not None:
        pose: Rigid = (mount.position, mount.rotation)
        values |= {"parent": mount.parent, "parent_from_camera": to_message(pose)}
        values |= {"date": max(mount.date, lens.date if lens else "")}
    return CameraInfo(**{name: getattr(info, name) for name in info.__struct_fields__} | values)


def exact_info(record: CameraRecord, base_frame: str) -> CameraInfo:
    """What cell.toml says of a camera: of a virtual one that is what it renders by."""
    width, height = record.size
    focal = width / (2.0 * math.tan(record.field_of_view / 2.0))
    matrix = (focal, 0.0, (width - 1) / 2.0, 0.0, focal, (height - 1) / 2.0, 0.0, 0.0, 1.0)
    return CameraInfo(
        name=record.name,
        width=width,
        height=height,
        intrinsics=matrix,
        distortion=record.source.distortion if isinstance(record.source, VirtualSource) else (),
        parent=record.parent or base_frame,
        parent_from_camera=to_message((record.position, looking(record.position, record.look_at, record.roll))),
    )


def scaled(intrinsics: tuple[float, ...], measured: tuple[int, int], wanted: tuple[int, int]) -> tuple[float, ...]:
    """K (9,) [px] of another size of the same picture: a pixel's centre is a whole number, so its edge is -0.5."""
    across, down = wanted[0] / measured[0], wanted[1] / measured[1]
    fx, skew, cx, _, fy, cy = intrinsics[:6]
    return (
        fx * across, skew * across, (cx + 0.5) * across - 0.5, 0.0, fy * down, (cy + 0.5) * down - 0.5, 0.0, 0.0, 1.0,
    )  # fmt: skip


def looking(position: Point, look_at: Point, roll: float) -> Quaternion:
    """The optical frame's turn: z from `position` to `look_at`, the parent's z (or x) up, then `roll` [rad] about z."""
    forward = _unit(_minus(look_at, position))
    up = (1.0, 0.0, 0.0) if abs(forward[2]) > ALONG else (0.0, 0.0, 1.0)
    right = _unit(_cross(forward, up))
    down = _cross(forward, right)
    return multiply(_quaternion(right, down, forward), from_axis_angle((0.0, 0.0, 1.0), roll))


def _quaternion(x: Point, y: Point, z: Point) -> Quaternion:
    """Of the rotation whose columns are unit axes (Shepperd 1978)."""
    trace = x[0] + y[1] + z[2]
    squares = (1.0 + x[0] - y[1] - z[2], 1.0 - x[0] + y[1] - z[2], 1.0 - x[0] - y[1] + z[2], 1.0 + trace)
    largest = squares.index(max(squares))
    s = 2.0 * math.sqrt(squares[largest])
    a, b, c = (y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s
    d, e, f = (y[0] + x[1]) / s, (z[0] + x[2]) / s, (z[1] + y[2]) / s
    return ((s / 4.0, d, e, a), (d, s / 4.0, f, b), (e, f, s / 4.0, c), (a, b, c, s / 4.0))[largest]


def _minus(first: Point, second: Point) -> Point:
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


def _cross(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _unit(vector: Point) -> Point:
    length = math.sqrt(sum(value * value for value in vector))
    return vector[0] / length, vector[1] / length, vector[2] / length
