"""MoveIt's joint_limits.yaml beside a URDF: positions and velocities into its limits, accelerations for robot.toml."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.robot_import.mended import LEFT_OUT, Mended, subject_of, unreadable, with_remedy
from gemelo.libraries.robot_import.motion_limits import ends_of, joints_of, set_ends
from gemelo.schemas.reasons import Remedy, Value, because, remedy
from gemelo.schemas.text_file import NotUtf8, read_text

FILE = "joint_limits.yaml"
CARTESIAN = ("cartesian_limits.yaml",)  # the ends of names: pilz_cartesian_limits.yaml
NOT_TAKEN = ("jerk", "deceleration")  # limits that nothing here takes from there


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
        except DescriptionError as why:
            left_out = remedy("left_out_file", file=str(file))
            mended.warn(root, Subject(within=file.name), with_remedy(why.reason, left_out))
            continue
        if not names & set(tables):
            continue
        if taken is not None:
            another = because("mend.moveit.another", remedy("left_out_nearest"), file=str(file), taken=str(taken))
            mended.warn(root, Subject(within=file.name), another)
            continue
        taken = file
        for element, joint in joints_of(mended):
            if joint.name in tables and joint.kind is not JointKind.FIXED:
                _narrow(mended, file, element, joint, tables[joint.name])
        for name in sorted(set(tables) - names):
            mended.warn(root, Subject(within=file.name), because("mend.moveit.joint", LEFT_OUT, joint=name))
        for key, value in others.items():
            factor = because("mend.moveit.factor", remedy("left_out_speed"), key=key, value=str(value))
            mended.say(root, Subject(within=file.name), factor)
    for file in mended.source.beside(*CARTESIAN):
        mended.say(root, Subject(within=file.name), because("mend.moveit.path", remedy("left_out_own_limits")))


def _tables(file: Path) -> tuple[dict[str, Mapping[str, Any]], dict[str, object]]:
    """The limits by joint, and what is said of all of them; raises `DescriptionError`."""
    try:
        data = yaml.load(read_text(file), Loader=_Yaml)  # noqa: S506: a SafeLoader with two more tags
    except (OSError, NotUtf8, yaml.YAMLError) as error:
        raise DescriptionError(unreadable(error)) from error
    parent = _holding(data)
    if parent is None:
        raise DescriptionError(because("mend.moveit.no_limits"))
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
    subject, written = subject_of(element), []
    lower, upper = ends_of(joint.limit)
    low, high = (
        _value(table, "has_position_limits", "min_position"),
        _value(table, "has_position_limits", "max_position"),
    )
    narrow = max(lower, -math.inf if low is None else low), min(upper, math.inf if high is None else high)
    if joint.kind is JointKind.CONTINUOUS and (low is not None or high is not None):
        mended.warn(element, subject, because("mend.moveit.continuous", remedy("left_out_revolute"), file=file.name))
    elif narrow[0] >= narrow[1]:
        mend = remedy("left_out_correct")
        mended.warn(element, subject, because("mend.moveit.no_travel", mend, file=file.name, lower=lower, upper=upper))
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
    taken = _taken(", ".join(written), mended.accelerations.get(joint.name), joint.kind is JointKind.PRISMATIC)
    if taken is not None:
        mended.say(element, subject, because("mend.moveit.further", taken, file=file.name))
    for what in NOT_TAKEN:
        value = _value(table, f"has_{what}_limits", f"max_{what}")
        if value is not None:
            limited = because("mend.moveit.quantity", LEFT_OUT, file=file.name, quantity=what, value=value)
            mended.say(element, subject, limited)


def _taken(text: str, acceleration: float | None, slides: bool) -> Remedy | None:
    """What was taken: attributes of <limit>, an acceleration [rad/s^2] or [m/s^2], or both; None of nothing."""
    if acceleration is None:
        return remedy("written", text=text) if text else None
    value: dict[str, Value] = {"acceleration": acceleration, "unit": "m/s^2" if slides else "rad/s^2"}
    return remedy("written_with_ramp", text=text, **value) if text else remedy("for_the_ramp", **value)


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
