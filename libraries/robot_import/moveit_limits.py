"""MoveIt's joint_limits.yaml beside a URDF: positions and velocities into its limits, accelerations for robot.toml."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.motion_limits import ends_of, joints_of, set_ends
from gemelo.schemas.text_file import NotUtf8, read_text

FILE = "joint_limits.yaml"
CARTESIAN = ("cartesian_limits.yaml",)  # the ends of names: pilz_cartesian_limits.yaml
LEFT_OUT = ("jerk", "deceleration")  # limits that nothing here takes from there


_Yaml: Any = type("_Yaml", (yaml.SafeLoader,), {})  # with the tags that ROS gives to angles
_Yaml.add_constructor("!degrees", lambda loader, node: math.radians(float(loader.construct_scalar(node))))
_Yaml.add_constructor("!radians", lambda loader, node: float(loader.construct_scalar(node)))


def joint_limits(mended: Mended) -> None:
    """Narrows each joint by the first joint_limits.yaml beside the source that names one of its joints."""
    names = set(mended.model.joint_names)
    root = mended.xml.root
    taken: Path | None = None
    for file in mended.source.beside(FILE):
        try:
            tables, others = _tables(file)
        except ValueError as why:
            mended.warn(root, file.name, f"cannot be read: {why}", f"left out: {file}")
            continue
        if not names & set(tables):
            continue
        if taken is not None:
            mended.warn(root, file.name, f"{file} is another one beside {taken}", "left out: the nearest is used")
            continue
        taken = file
        for element, joint in joints_of(mended):
            if joint.name in tables and joint.kind is not JointKind.FIXED:
                _narrow(mended, file, element, joint, tables[joint.name])
        for name in sorted(set(tables) - names):
            mended.warn(root, file.name, f'it limits joint "{name}", which the URDF does not have', "left out")
        for key, value in others.items():
            remedy = "left out: `--speed` of a move, or a smaller velocity, does that here"
            mended.say(root, file.name, f"{key} is {value}", remedy)
    for file in mended.source.beside(*CARTESIAN):
        mended.say(root, file.name, "limits the speed of the tool on its path", "left out: a move's own limits do")


def _tables(file: Path) -> tuple[dict[str, Mapping[str, Any]], dict[str, object]]:
    """The limits by joint, and what is said of all of them; raises ValueError."""
    try:
        data = yaml.load(read_text(file), Loader=_Yaml)  # noqa: S506: a SafeLoader with two more tags
    except (OSError, NotUtf8, yaml.YAMLError) as error:
        raise ValueError(" ".join(str(error).split())) from error
    parent = _holding(data)
    if parent is None:
        raise ValueError("it has no joint_limits")
    tables = {str(name): table for name, table in parent["joint_limits"].items() if isinstance(table, Mapping)}
    return tables, {key: value for key, value in parent.items() if key.startswith("default_") and value != 1.0}


def _holding(data: object) -> Mapping[str, Any] | None:
    """The mapping in which joint_limits is: at the top, or below the names of a ROS 2 parameter file."""
    if not isinstance(data, Mapping):
        return None
    if isinstance(data.get("joint_limits"), Mapping):
        return data
    return next((found for value in data.values() if (found := _holding(value)) is not None), None)


def _narrow(mended: Mended, file: Path, element: ET.Element, joint: UrdfJoint, table: Mapping[str, Any]) -> None:
    subject, written = f'joint "{joint.name}"', []
    lower, upper = ends_of(joint.limit)
    low, high = (
        _value(table, "has_position_limits", "min_position"),
        _value(table, "has_position_limits", "max_position"),
    )
    narrow = max(lower, -math.inf if low is None else low), min(upper, math.inf if high is None else high)
    if joint.kind is JointKind.CONTINUOUS and (low is not None or high is not None):
        mended.warn(element, subject, f"{file.name} limits it, and it is continuous", 'left out: write type="revolute"')
    elif narrow[0] >= narrow[1]:
        message = f"{file.name} leaves no travel within its limits {lower:g} to {upper:g}"
        mended.warn(element, subject, message, "left out: correct it")
    elif narrow != (lower, upper):
        written.append(set_ends(element, *narrow))
    velocity = _value(table, "has_velocity_limits", "max_velocity")
    own = joint.limit.velocity if joint.limit is not None else 0.0
    if velocity is not None and velocity > 0.0 and not 0.0 < own <= velocity:
        set_limit(element, "velocity", velocity)
        written.append(f'velocity="{velocity:.9g}"')
    acceleration = _value(table, "has_acceleration_limits", "max_acceleration")
    if acceleration is not None and acceleration > 0.0:
        mended.accelerations[joint.name] = acceleration
        written.append(f"{acceleration:g} {'m' if joint.kind is JointKind.PRISMATIC else 'rad'}/s^2 for its ramp_time")
    if written:
        mended.say(element, subject, f"{file.name} beside it limits it further", ", ".join(written))
    for what in LEFT_OUT:
        value = _value(table, f"has_{what}_limits", f"max_{what}")
        if value is not None:
            mended.say(element, subject, f"{file.name} limits its {what} to {value:g}", "left out")


def set_limit(element: ET.Element, key: str, value: float) -> None:
    """Writes an attribute of the <limit> of a joint, in [rad], [m], [rad/s] or [m/s]."""
    limit = element.find("limit")
    if limit is None:
        limit = ET.SubElement(element, "limit")
    limit.set(key, f"{value:.9g}")


def _value(table: Mapping[str, Any], switch: str, key: str) -> float | None:
    """A finite number that is switched on; None for another."""
    value = table.get(key)
    is_on = table.get(switch, value is not None)
    if not is_on or isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        return None
    return float(value)
