"""`gemelo check`: everything that can be known to be wrong with a robot's folder before anything moves."""

from __future__ import annotations

import logging
import math
from pathlib import Path

import msgspec

from gemelo.libraries.arm.checks.device import check_device
from gemelo.libraries.arm.checks.findings import Finding, Severity, error, note, once, warning
from gemelo.libraries.arm.checks.homing import check_homing
from gemelo.libraries.arm.checks.meshes import check_meshes, mesh_facts
from gemelo.libraries.arm.checks.motors import check_motors, check_pull_out
from gemelo.libraries.arm.checks.srdf import check_srdf
from gemelo.libraries.arm.checks.urdf import check_urdf, fault_finding
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import DEFAULT_URDF, ROBOT_FILE, ArmDescription, load_arm
from gemelo.libraries.arm.model.robot_file import (
    dotted,
    line_of,
    not_finite,
    parse_toml,
    read_text,
    typed_robot,
    unknown_keys,
)
from gemelo.libraries.arm.model.srdf import read_srdf
from gemelo.libraries.arm.model.urdf import UrdfModel, survey_urdf
from gemelo.libraries.arm.model.virtual_drive import TO_DRIVE, lacks_motors, with_virtual_drive
from gemelo.libraries.toml_lines import type_mistake
from gemelo.schemas.reasons import Remedy, because, remedy
from gemelo.schemas.robot import RobotFile

__all__ = ["Finding", "Severity", "check"]

NOWHERE = Subject("")  # of a whole line
TOLERANCE = 1e-9  # [m]


def check(folder: Path) -> list[Finding]:
    """Every finding in `folder`, errors first; empty where all is well."""
    folder = Path(folder)
    try:
        text = read_text(folder / ROBOT_FILE)
        data = parse_toml(folder / ROBOT_FILE, text)
    except DescriptionError as problem:
        whole = because("robot.unreadable", problem.reason, remedy("folder_with_robot_file"))
        return [error(ROBOT_FILE, Subject("file"), whole)]
    findings = [*_unknown_keys(data, text), *_not_finite(data, text)]
    urdf_path = folder / str(data.get("urdf", DEFAULT_URDF))
    try:
        model, faults = survey_urdf(urdf_path)
    except DescriptionError as problem:
        return [*findings, error(urdf_path.name, Subject("file"), problem.reason)]
    findings += [fault_finding(fault, urdf_path.name) for fault in faults]
    try:
        is_bare = lacks_motors(data, folder / ROBOT_FILE)
        robot = typed_robot(with_virtual_drive(_known(data), model) if is_bare else _known(data))
    except DescriptionError as problem:
        whole = because("robot.unreadable", problem.reason, TO_DRIVE)
        return [*findings, error(ROBOT_FILE, Subject("motors"), whole)]
    except msgspec.ValidationError as problem:
        line, what = type_mistake(problem, text)
        whole = because("robot.unreadable", what, remedy("value_of_that_type"))
        return [*findings, error(ROBOT_FILE, NOWHERE if line else Subject("types"), whole, line=line)]
    if not_finite(data):
        return findings
    findings += _files(folder, robot, model)
    if not any(finding.severity is Severity.ERROR for finding in findings):
        findings += _cross_checks(folder)
    if is_bare:
        findings.append(note(ROBOT_FILE, Subject("robot"), because("robot.no_motors", TO_DRIVE)))
    return sorted(once(findings), key=lambda finding: list(Severity).index(finding.severity))


def _unknown_keys(data: dict[str, object], text: str) -> list[Finding]:
    return [error(ROBOT_FILE, NOWHERE, key.reason, line=key.line) for key in unknown_keys(data, text)]


def _not_finite(data: dict[str, object], text: str) -> list[Finding]:
    return [
        error(
            ROBOT_FILE,
            NOWHERE,
            because("file.value.not_finite", key=dotted(key), value=value),
            line=line_of(key, text),
        )
        for key, value in not_finite(data)
    ]


def _known(data: dict[str, object]) -> dict[str, object]:
    """`data` without the keys that its types do not have, so that one of them does not hide what else is wrong."""
    unknown = {key.path for key in unknown_keys(data, "")}

    def keep(value: object, path: tuple[str | int, ...]) -> object:
        if isinstance(value, dict):
            return kept(value, path)
        if isinstance(value, list):
            return [keep(v, (*path, i)) for i, v in enumerate(value)]
        return value

    def kept(table: dict[str, object], path: tuple[str | int, ...]) -> dict[str, object]:
        return {k: keep(v, (*path, k)) for k, v in table.items() if (*path, k) not in unknown}

    return kept(data, ())


def _files(folder: Path, robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Each file for itself, then the motors against the URDF."""
    findings = check_urdf(model, folder / robot.urdf)
    findings += check_motors(robot, model)
    findings += check_device(robot)
    findings += check_homing(robot, model)
    findings += check_pull_out(robot)
    try:
        findings += check_srdf(read_srdf(folder / robot.srdf), robot, model)
    except DescriptionError as problem:
        findings.append(error(robot.srdf, Subject("file"), problem.reason))
    return findings


def _cross_checks(folder: Path) -> list[Finding]:
    """Checks that need the whole description."""
    try:
        arm = load_arm(folder)
        device_config(arm)
    except DescriptionError as problem:
        return [error(ROBOT_FILE, Subject("robot"), problem.reason)]
    # The meshes themselves only where yourdfpy has opened them all.
    return check_with_yourdfpy(arm) or check_meshes(arm.model, arm.urdf_path.name, mesh_facts(arm.urdf_path.parent))


def check_with_yourdfpy(arm: ArmDescription) -> list[Finding]:
    """Findings of yourdfpy on the arm's URDF; a warning where it is not installed."""
    file = arm.urdf_path.name
    try:
        import yourdfpy  # slow to load: trimesh comes with it
    except ModuleNotFoundError:
        return [warning(file, Subject("meshes"), because("mesh.no_reader_installed", remedy("install_view")))]
    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)  # what it would warn of, the other checks say with lines
    try:
        other = yourdfpy.URDF.load(str(arm.urdf_path))
    except Exception as problem:  # of any mesh format's reader
        whole = because("mesh.not_loaded", _suspects(arm.folder), problem=str(problem))
        return [error(file, Subject("meshes"), whole)]
    middle = [(joint.lower + joint.upper) / 2 if math.isfinite(joint.lower) else 0.0 for joint in arm.joints]
    other.update_cfg(dict(zip(arm.joint_names, middle, strict=True)))
    theirs = other.get_transform(arm.tool_frame, arm.base_frame)[:3, 3]
    poses = link_transforms(arm.model, dict(zip(arm.joint_names, middle, strict=True)))
    base, tool = poses[arm.base_frame][0], poses[arm.tool_frame][0]
    ours = [b - a for a, b in zip(base, tool, strict=True)]
    off = max(abs(a - b) for a, b in zip(ours, theirs, strict=True))
    if off > TOLERANCE:
        return [error(file, Subject("link", arm.tool_frame), because("urdf.other_place", distance=off))]
    return []


def _suspects(folder: Path) -> Remedy:
    names = tuple(sorted(path.name for path in folder.glob("meshes/*")))
    return remedy("export_one_again", names=names) if names else remedy("correct_urdf")
