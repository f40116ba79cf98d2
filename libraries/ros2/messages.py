"""The arm in messages of ROS 2: joint states, frames, description, diagnostics and the log."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.ros2.types import make
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import LogLevel, LogRecord

SECOND = 1_000_000_000  # [ns]
OK, WARN, ERROR, STALE = 0, 1, 2, 3  # the levels of diagnostic_msgs/DiagnosticStatus
MESH = re.compile(r'(<mesh\b[^>]*\bfilename\s*=\s*")([^"]*)(")')


def time_of(stamp: int) -> Any:
    """builtin_interfaces/Time of `stamp` [ns]."""
    return make("builtin_interfaces/msg/Time", sec=stamp // SECOND, nanosec=stamp % SECOND)


def duration_of(seconds: float) -> Any:
    """builtin_interfaces/Duration of [s]."""
    whole = round(seconds * SECOND)
    return make("builtin_interfaces/msg/Duration", sec=whole // SECOND, nanosec=whole % SECOND)


def nanoseconds(time: Any) -> int:
    """[ns] of a builtin_interfaces Time or Duration."""
    return int(time.sec) * SECOND + int(time.nanosec)


def header_of(stamp: int, frame: str = "") -> Any:
    """std_msgs/Header of `stamp` [ns]."""
    return make("std_msgs/msg/Header", stamp=time_of(stamp), frame_id=frame)


def joint_state(state: JointState) -> Any:
    """sensor_msgs/JointState: the stamp is that of the measurement, and effort is empty, as nothing measures it."""
    return make(
        "sensor_msgs/msg/JointState",
        header=header_of(state.stamp),
        name=list(state.name),
        position=_floats(state.position),
        velocity=_floats(state.velocity),
        effort=_floats(state.effort),
    )


def frames(message: FrameTransforms, prefix: str = "") -> Any:
    """tf2_msgs/TFMessage; `prefix` stands before the name of each frame."""
    transforms = [_transform(each, prefix) for each in message.transforms]
    return make("tf2_msgs/msg/TFMessage", transforms=transforms)


def _transform(frame: FrameTransform, prefix: str) -> Any:
    translation, rotation = frame.transform.translation, frame.transform.rotation
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header_of(frame.stamp, prefix + frame.parent),
        child_frame_id=prefix + frame.child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", **dict(zip("xyz", translation, strict=True))),
            rotation=make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", rotation, strict=True))),
        ),
    )


def string(text: str) -> Any:
    """std_msgs/String."""
    return make("std_msgs/msg/String", data=text)


def relative_meshes(urdf: str) -> tuple[str, ...]:
    """The addresses of meshes that begin with no scheme."""
    return tuple(dict.fromkeys(found[2] for found in MESH.finditer(urdf) if "://" not in found[2]))


def urdf_with_meshes(urdf: str, address_of: Callable[[str], str]) -> str:
    """The URDF with other addresses of the meshes that have a relative one: RViz resolves none of these."""

    def absolute(found: re.Match[str]) -> str:
        return f"{found[1]}{found[2] if '://' in found[2] else address_of(found[2])}{found[3]}"

    return MESH.sub(absolute, urdf)


def diagnostics(
    now: int, robot: str, status: DeviceStatus | None, state: DeviceState | None, errors: StepErrors | None,
    refusal: Reason | None,
) -> Any:  # fmt: skip
    """diagnostic_msgs/DiagnosticArray at `now` [ns]: device, steps, and the last goal of ROS if it was refused."""
    return make(
        "diagnostic_msgs/msg/DiagnosticArray",
        header=header_of(now),
        status=[_device(robot, status, state), _steps(robot, errors), _goals(robot, refusal)],
    )


def _device(robot: str, status: DeviceStatus | None, state: DeviceState | None) -> Any:
    if status is None:
        return _status(f"{robot}: device", "", STALE, _silent(), ())
    level = ERROR if not status.online else WARN if status.warning or (state and state.fault) else OK
    mode = state.mode.name if state is not None else "offline"
    values = [("firmware", status.firmware), ("virtual", str(status.virtual)), ("mode", mode)]
    if state is not None:
        values += [("armed", str(state.armed)), ("fault", str(state.fault)), ("underruns", str(state.underruns))]
    return _status(f"{robot}: device", status.device, level, status.reason or status.warning or mode, values)


def _steps(robot: str, errors: StepErrors | None) -> Any:
    if errors is None:
        return _status(f"{robot}: steps", "", STALE, _silent(), ())
    values = [(name, f"{error:.3f}") for name, error in zip(errors.name, errors.error, strict=True)]
    return _status(f"{robot}: steps", "", OK, str(because("ros.diagnostics.steps")), values)


def _goals(robot: str, refusal: Reason | None) -> Any:
    text = str(refusal) if refusal is not None else ""
    return _status(f"{robot}: goals", "", WARN if text else OK, text, ())


def _silent() -> str:
    return str(because("ros.diagnostics.silent"))


def _status(name: str, hardware: str, level: int, message: str, values: Iterable[tuple[str, str]]) -> Any:
    return make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=level,
        name=name,
        message=message,
        hardware_id=hardware,
        values=[make("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in values],
    )


def log_record(record: LogRecord) -> Any:
    """rcl_interfaces/Log, whose levels are ours."""
    return log(record.stamp, record.level, record.node, record.text)


def log(stamp: int, level: LogLevel, node: str, text: str) -> Any:
    """rcl_interfaces/Log at `stamp` [ns]."""
    return make(
        "rcl_interfaces/msg/Log",
        stamp=time_of(stamp), level=int(level), name=node, msg=text, file="", function="", line=0,
    )  # fmt: skip


def _floats(values: Vector) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)
