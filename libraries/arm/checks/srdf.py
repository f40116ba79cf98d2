"""Checks of the SRDF: its references, and named states within the joints' limits."""

from __future__ import annotations

from collections.abc import Iterable

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import Subject, nearest
from gemelo.libraries.arm.model.srdf import Group, NamedState, SrdfModel
from gemelo.libraries.arm.model.urdf import JointKind, UrdfModel
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import RobotFile


def check_srdf(srdf: SrdfModel, robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Everything the SRDF refers to."""
    file = robot.srdf
    findings = []
    if srdf.name != model.name:
        what = because("srdf.name", remedy("name_alike"), name=srdf.name, urdf=model.name)
        findings.append(warning(file, Subject("robot"), what))
    groups = [group.name for group in srdf.groups]
    findings += _missing(file, Subject("robot.toml"), "group", [robot.group], groups)
    for group in srdf.groups:
        findings += _group(group, file, model)
    for state in srdf.states:
        findings += _missing(file, Subject("state", state.name), "group", [state.group], groups)
        findings += _state(state, file, robot, model)
    for pair in srdf.disabled:
        findings += _missing(file, Subject("disable_collisions"), "link", pair, model.link_names)
        if pair[0] == pair[1]:
            what = because("srdf.pair.itself", remedy("remove_it"), link=pair[0])
            findings.append(error(file, Subject("disable_collisions"), what))
    return findings


def _group(group: Group, file: str, model: UrdfModel) -> list[Finding]:
    subject = Subject("group", group.name)
    findings = _missing(file, subject, "joint", group.joints, model.joint_names)
    findings += _missing(file, subject, "link", group.links, model.link_names)
    for chain in group.chains:
        findings += _missing(file, subject, "link", chain, model.link_names)
    return findings


def _state(state: NamedState, file: str, robot: RobotFile, model: UrdfModel) -> list[Finding]:
    subject = Subject("state", state.name)
    findings = _missing(file, subject, "joint", state.values, model.joint_names)
    if state.group == robot.group:
        for drive in robot.joint:
            if drive.name not in state.values:
                what = because("srdf.state.no_value", remedy("name_every_joint"), joint=drive.name)
                findings.append(error(file, subject, what))
    for name, value in state.values.items():
        joint = model.joint(name) if name in model.joint_names else None
        limit = joint.limit if joint is not None else None
        if limit is not None and limit.lower < limit.upper and not limit.lower <= value <= limit.upper:
            unit = "m" if joint is not None and joint.kind is JointKind.PRISMATIC else "rad"
            near = remedy("nearest_in_limits", value=min(max(value, limit.lower), limit.upper), unit=unit)
            within = {"lower": limit.lower, "upper": limit.upper}
            what = because("srdf.state.limits", near, joint=name, value=value, unit=unit, **within)
            findings.append(error(file, subject, what))
    return findings


def _missing(file: str, subject: Subject, kind: str, names: Iterable[str], known: Iterable[str]) -> list[Finding]:
    there = list(known)
    return [
        error(file, subject, because("srdf.missing", nearest(name, there), kind=kind, name=name))
        for name in names
        if name not in there
    ]
