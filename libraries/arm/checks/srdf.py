"""Checks of the SRDF: its references, and named states within the joints' limits."""

from __future__ import annotations

from collections.abc import Iterable

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.srdf import Group, NamedState, SrdfModel
from gemelo.libraries.arm.model.urdf import UrdfModel
from gemelo.schemas.robot import RobotFile


def check_srdf(srdf: SrdfModel, robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Everything the SRDF refers to."""
    file = robot.srdf
    findings = []
    if srdf.name != model.name:
        findings.append(warning(file, "robot", f'is named "{srdf.name}", the URDF "{model.name}"', "name them alike"))
    groups = [group.name for group in srdf.groups]
    findings += _missing(file, "robot.toml", "group", [robot.group], groups)
    for group in srdf.groups:
        findings += _group(group, file, model)
    for state in srdf.states:
        findings += _missing(file, f'state "{state.name}"', "group", [state.group], groups)
        findings += _state(state, file, robot, model)
    for pair in srdf.disabled:
        findings += _missing(file, "disable_collisions", "link", pair, model.link_names)
        if pair[0] == pair[1]:
            findings.append(error(file, "disable_collisions", f'"{pair[0]}" with itself', "remove it"))
    return findings


def _group(group: Group, file: str, model: UrdfModel) -> list[Finding]:
    subject = f'group "{group.name}"'
    findings = _missing(file, subject, "joint", group.joints, model.joint_names)
    findings += _missing(file, subject, "link", group.links, model.link_names)
    for chain in group.chains:
        findings += _missing(file, subject, "link", chain, model.link_names)
    return findings


def _state(state: NamedState, file: str, robot: RobotFile, model: UrdfModel) -> list[Finding]:
    subject = f'state "{state.name}"'
    findings = _missing(file, subject, "joint", state.values, model.joint_names)
    if state.group == robot.group:
        for drive in robot.joint:
            if drive.name not in state.values:
                findings.append(error(file, subject, f"has no value for {drive.name}", "a state names every joint"))
    for name, value in state.values.items():
        limit = model.joint(name).limit if name in model.joint_names else None
        if limit is not None and limit.lower < limit.upper and not limit.lower <= value <= limit.upper:
            message = f"{name} = {value:g} is outside {limit.lower:g} to {limit.upper:g}"
            findings.append(
                error(file, subject, message, f"the nearest is {min(max(value, limit.lower), limit.upper):g}")
            )
    return findings


def _missing(file: str, subject: str, kind: str, names: Iterable[str], known: Iterable[str]) -> list[Finding]:
    there = list(known)
    return [
        error(file, subject, f'{kind} "{name}" does not exist{suggestion(name, there)}')
        for name in names
        if name not in there
    ]
