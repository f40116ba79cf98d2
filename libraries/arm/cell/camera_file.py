"""camera.toml: what the wizard has measured of each camera, read strictly and written whole."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import msgspec

from gemelo.libraries.arm.errors import nearest, wrong_file
from gemelo.libraries.arm.model.robot_file import read_robot_data, read_text
from gemelo.libraries.toml_lines import type_mistake
from gemelo.schemas.cell import CameraFile, MeasuredCamera
from gemelo.schemas.reasons import because, remedy

CAMERA_FILE = "camera.toml"
MOUNT_BOARD = "mount_board"  # in the planning scene: the tags on the arm, while `gemelo camera mount` shows them
HEADER = "# Measured by `gemelo camera calibrate` and `gemelo camera mount`: measure again instead of editing it.\n"
REMEDY = remedy("measure_camera_again")


def load_measured(path: Path, cameras: Sequence[str]) -> dict[str, MeasuredCamera]:
    """By the camera's name; empty where there is no file. Raises `DescriptionError`, also for a camera of no cell."""
    return measured_of(path, read_text(path), cameras) if path.exists() else {}


def measured_of(path: Path, text: str, cameras: Sequence[str]) -> dict[str, MeasuredCamera]:
    """As `load_measured`, of the text that stands at `path`."""
    data = read_robot_data(path, text, CameraFile)
    try:
        file = msgspec.convert(data, CameraFile)
    except msgspec.ValidationError as error:
        line, what = type_mistake(error, text)
        raise wrong_file(path, because("camera.measured", what, REMEDY), line) from error
    for camera in file.camera:
        if camera.name not in cameras:
            raise wrong_file(path, because("camera.not_in_cell", nearest(camera.name, cameras), camera=camera.name))
        _require_sizes(path, camera)
    return {camera.name: camera for camera in file.camera}


def write_measured(path: Path, cameras: Sequence[MeasuredCamera]) -> None:
    """Replaces the file at once, so that a reader finds the old or the new one."""
    text = HEADER + "".join(_table(camera) for camera in cameras)
    beside = path.with_name(f".{path.name}.new")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)


def _require_sizes(path: Path, camera: MeasuredCamera) -> None:
    lens = camera.calibration
    if lens is not None and (len(lens.intrinsics) != 9 or len(lens.distortion) not in (0, 5)):
        counts = {"intrinsics": len(lens.intrinsics), "distortion": len(lens.distortion)}
        raise wrong_file(path, because("camera.measured.sizes", REMEDY, camera=camera.name, **counts))
    mount = camera.mount
    if mount is not None and abs(sum(value * value for value in mount.rotation) - 1.0) > 1e-3:
        raise wrong_file(path, because("camera.measured.rotation", REMEDY, camera=camera.name))


def _table(camera: MeasuredCamera) -> str:
    lines = ["", "[[camera]]", f"name = {_value(camera.name)}"]
    for key in ("calibration", "mount"):
        record = getattr(camera, key)
        if record is not None:
            lines += ["", f"[camera.{key}]"]
            lines += [f"{name} = {_value(value)}" for name, value in msgspec.structs.asdict(record).items()]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    match value:
        case tuple():
            return f"[{', '.join(map(_value, value))}]"
        case str():
            return msgspec.json.encode(value).decode()  # a JSON string is a TOML string too
        case _:
            return repr(value)
