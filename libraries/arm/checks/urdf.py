"""Checks of the URDF: the tree, references to links and meshes, limits, inertias."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.checks.units import LARGEST_GYRATION, check_units, gyration
from gemelo.libraries.arm.errors import nearest_name, suggestion
from gemelo.libraries.arm.model.description import ROUNDING
from gemelo.libraries.arm.model.urdf import (
    NO_SHAPE,
    Geometry,
    Inertial,
    JointKind,
    Limit,
    UrdfJoint,
    UrdfLink,
    UrdfModel,
)
from gemelo.libraries.arm.model.xml_reader import XmlFault

UNTOUCHED = "can be seen but not touched: it has no <collision>"
COLLISION_REMEDY = "add a box or a cylinder, or let `gemelo collision fit --meshes` fit some"
MESHES = (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
SHAPES = ("box", "cylinder", "sphere", "mesh")
MOST_TRAVEL = {JointKind.REVOLUTE: 4.01 * math.tau, JointKind.PRISMATIC: 5.0}  # [rad] or [m]
LEAST_TURN = 0.99 * math.tau  # [rad] of a continuous joint: limits of a whole turn say nothing
MOST_VELOCITY = {JointKind.REVOLUTE: 50.0, JointKind.CONTINUOUS: 50.0, JointKind.PRISMATIC: 10.0}  # [rad/s] or [m/s]
FRAME_REMEDY = "leave <inertial> out where the link is a mere frame, else give a mass above 0"
LEADER_REMEDY = "name the joint that has the motor in <mimic>"
PLACEHOLDER_EFFORTS = (100.0, 300.0, 1000.0)  # what exporters write when nobody thought about it


class FollowerRange(NamedTuple):
    """[rad] or [m] where a follower is led, its own limits, and the limits of its leader that keep within them."""

    low: float
    high: float
    lower: float
    upper: float
    narrow: tuple[float, float] | None


def check_urdf(model: UrdfModel, path: Path, has_meshes: bool = True) -> list[Finding]:
    """Everything about the URDF alone; without its meshes' references where it is not yet in a robot's folder."""
    file = path.name
    findings = _tree(model, file)
    for link in model.links:
        findings += _link(link, path, has_meshes)
    for joint in model.joints:
        findings += _references(joint, model, file)
        if joint.kind is not JointKind.FIXED and joint.mimic is None:
            findings += _limits(joint, file)
    return [*findings, *check_units(model, file)]


def fault_finding(fault: XmlFault, file: str) -> Finding:
    """What could not be read, as a finding."""
    return error(file, fault.where, fault.message, fault.remedy, fault.line)


def _tree(model: UrdfModel, file: str) -> list[Finding]:
    """One root, every link once, every child once."""
    findings = []
    things: dict[str, tuple[UrdfLink | UrdfJoint, ...]] = {"link": model.links, "joint": model.joints}
    for what, named in things.items():
        lines = defaultdict[str, list[int]](list)
        for thing in named:
            lines[thing.name].append(thing.line)
        for name, found in lines.items():
            if len(found) > 1 and name:
                subject, message = f'{what} "{name}"', f"is there {len(found)} times"
                findings.append(_at(found, file, subject, message, "names are unique: rename or remove one"))
    above = defaultdict[str, list[UrdfJoint]](list)
    for joint in model.joints:
        above[joint.child].append(joint)
    for name, joints in above.items():
        if len(joints) > 1 and name:
            message = f"is the child of {len(joints)} joints: {_quoted(joints)}"
            remedy = "a link has one parent: remove one of these joints, as no loop is followed"
            findings.append(_at([joint.line for joint in joints], file, f'link "{name}"', message, remedy))
    roots = [link for link in model.links if link.name not in above]
    if len(roots) > 1:
        message = f"has {len(roots)} roots ({', '.join(root.name for root in roots)})"
        remedy = "join them with a fixed joint, or remove what is no part of the arm"
        findings.append(_at([root.line for root in roots], file, "tree", message, remedy))
    return [*findings, *_rings(model, above, file)]


def _rings(model: UrdfModel, above: dict[str, list[UrdfJoint]], file: str) -> Iterator[Finding]:
    """Of joints that carry each other, each once."""
    connected = _connected(model, [name for name in model.link_names if name not in above])
    said: set[str] = set()
    for name in model.link_names:
        passed: list[UrdfJoint] = []
        link = name
        while link not in connected and link in above and above[link][-1] not in passed:
            passed.append(above[link][-1])
            link = passed[-1].parent
        if link in connected or link not in above or passed[-1].name in said:
            continue
        ring = passed[passed.index(above[link][-1]) :][::-1]
        said |= {joint.name for joint in passed}
        message = f"is not connected to a root: its joints form a ring, {_quoted(ring)}"
        remedy = "correct <parent> or <child> of the joint that closes it, or remove that joint"
        yield _at([joint.line for joint in ring], file, f'link "{link}"', message, remedy)


def _at(lines: list[int], file: str, subject: str, message: str, remedy: str) -> Finding:
    """An error in several lines."""
    first, *others = sorted(set(lines))
    return replace(error(file, subject, message, remedy, first), also=tuple(others))


def _quoted(joints: list[UrdfJoint]) -> str:
    return ", ".join(f'"{joint.name}"' for joint in joints)


def _connected(model: UrdfModel, roots: list[str]) -> set[str]:
    """Every link that a chain of joints leads to from a root."""
    reached, front = set(roots), list(roots)
    while front:
        parent = front.pop()
        for joint in model.joints:
            if joint.parent == parent and joint.child not in reached:
                reached.add(joint.child)
                front.append(joint.child)
    return reached


def _references(joint: UrdfJoint, model: UrdfModel, file: str) -> list[Finding]:
    findings = []
    for role, link in (("parent", joint.parent), ("child", joint.child)):
        if link and link not in model.link_names:
            hint = suggestion(link, model.link_names)
            message = f'its {role} "{link}" is no link{hint}'
            remedy = f"write the name of a link in <{role}>"
            findings.append(error(file, f'joint "{joint.name}"', message, remedy, joint.line))
    return [*findings, *_mimic(joint, model, file)]


def _mimic(joint: UrdfJoint, model: UrdfModel, file: str) -> list[Finding]:
    """A joint follows one that has a motor of its own."""
    if joint.mimic is None or joint.kind is JointKind.FIXED:
        return []
    subject, name = f'joint "{joint.name}"', joint.mimic.joint
    if name not in model.joint_names:
        message = f'mimics "{name}", which is no joint{suggestion(name, model.joint_names)}'
        return [error(file, subject, message, LEADER_REMEDY, joint.line)]
    leader = model.joint(name)
    if leader.kind is JointKind.FIXED or leader.mimic is not None:
        how = "is fixed" if leader.kind is JointKind.FIXED else "follows another itself"
        how = "is this very joint" if name == joint.name else how
        return [error(file, subject, f'mimics "{name}", which {how}', LEADER_REMEDY, joint.line)]
    reach = follower_range(joint, leader)
    if reach is None:
        return []
    message = f'follows "{name}" from {reach.low:.6g} to {reach.high:.6g}, beyond its own limits'
    message += f" {reach.lower:g} to {reach.upper:g}"
    if reach.narrow is None:
        remedy = f'correct its <limit> or <mimic>: within it "{name}" has no travel'
        return [error(file, subject, message, remedy, joint.line)]
    remedy = f'narrow the limits of "{name}" to {reach.narrow[0]:.6g} and {reach.narrow[1]:.6g}, or correct <mimic>'
    return [warning(file, subject, message, remedy, joint.line)]


def follower_range(joint: UrdfJoint, leader: UrdfJoint) -> FollowerRange | None:
    """Where `leader` takes its follower beyond the follower's own limits; None where it does not, or they have none."""
    mimic, own, led = joint.mimic, joint.limit, leader.limit
    if mimic is None or own is None or led is None or not own.lower < own.upper or not led.lower < led.upper:
        return None
    if JointKind.CONTINUOUS in (joint.kind, leader.kind) or JointKind.FIXED in (joint.kind, leader.kind):
        return None
    low, high = sorted(mimic.multiplier * end + mimic.offset for end in (led.lower, led.upper))
    if low >= own.lower - ROUNDING and high <= own.upper + ROUNDING:
        return None
    narrow = None
    if mimic.multiplier:
        first, last = sorted((end - mimic.offset) / mimic.multiplier for end in (own.lower, own.upper))
        first, last = max(first, led.lower), min(last, led.upper)
        narrow = (first, last) if first < last else None
    return FollowerRange(low, high, own.lower, own.upper, narrow)


def _link(link: UrdfLink, path: Path, has_meshes: bool) -> list[Finding]:
    subject = f'link "{link.name}"'
    findings = [] if link.inertial is None else _inertial(link.inertial, subject, path.name, link.line)
    for role, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for geometry in shapes:
            if has_meshes or geometry.mesh is None:
                findings += _geometry(geometry, role, subject, path)
    if has_meshes and link.visuals and not link.collisions:
        findings.append(warning(path.name, subject, UNTOUCHED, COLLISION_REMEDY, link.line))
    return findings


def _geometry(geometry: Geometry, role: str, subject: str, path: Path) -> list[Finding]:
    if geometry.shape == NO_SHAPE:
        return []
    if geometry.shape not in SHAPES:
        remedy = "write <cylinder>" if geometry.shape == "capsule" else f"use {', '.join(SHAPES)}"
        message = f"<{geometry.shape}> in <{role}> is not URDF and would be ignored"
        return [error(path.name, subject, message, remedy, geometry.line)]
    if geometry.mesh is None:
        return []
    if geometry.mesh.startswith("package://"):
        return [_package(geometry.mesh, subject, path, geometry.line)]
    if not (path.parent / geometry.mesh.removeprefix("file://")).is_file():
        message = f'mesh "{geometry.mesh}" is not there{_near_mesh(geometry.mesh, path.parent)}'
        return [error(path.name, subject, message, "put the file there", geometry.line)]
    return []


def _near_mesh(reference: str, folder: Path) -> str:
    """A hint at the file that may be meant: one that differs in folder or ending alone, else one of a like name."""
    files = [each for each in folder.glob("**/*") if each.suffix.lower() in MESHES]
    same = [each for each in files if each.stem.lower() == Path(reference).stem.lower()]
    if same:
        return f'; did you mean "{same[0].relative_to(folder)}"?'
    near = nearest_name(Path(reference).name, [each.name for each in files])
    return next((f'; did you mean "{each.relative_to(folder)}"?' for each in files if each.name == near), "")


def _package(reference: str, subject: str, path: Path, line: int) -> Finding:
    """A package:// path means nothing without ROS: say where the file is, if it is in this folder."""
    name = reference.rsplit("/", 1)[-1]
    found = sorted(path.parent.rglob(name))
    remedy = (
        f'write filename="{found[0].relative_to(path.parent)}"'
        if found
        else f"put {name} into this folder and write its path relative to {path.name}"
    )
    return error(path.name, subject, f'mesh "{reference}" is a ROS package path', remedy, line)


def _limits(joint: UrdfJoint, file: str) -> list[Finding]:
    subject, limit, line = f'joint "{joint.name}"', joint.limit, joint.line
    if limit is None:
        return [error(file, subject, "has no <limit>", "give lower, upper, effort and velocity", line)]
    findings = _travel(joint.kind, limit, subject, file, line)
    for name, value in (("velocity", limit.velocity), ("effort", limit.effort)):
        if not value > 0.0:
            findings.append(error(file, subject, f"its {name} limit is {value:g}", "give a value above 0", line))
    if limit.velocity > MOST_VELOCITY[joint.kind]:
        slides = joint.kind is JointKind.PRISMATIC
        message = f"its velocity limit of {limit.velocity:g} {'m/s' if slides else 'rad/s'} is implausible"
        asked = "are these mm/s?" if slides else "are these degrees per second?"
        findings.append(warning(file, subject, message, asked, line))
    if limit.effort in PLACEHOLDER_EFFORTS:
        message = f"effort {limit.effort:g} looks like an exporter's placeholder"
        findings.append(warning(file, subject, message, "give the motor's own", line))
    return findings


def _travel(kind: JointKind, limit: Limit, subject: str, file: str, line: int) -> list[Finding]:
    travel = limit.upper - limit.lower
    if kind is JointKind.CONTINUOUS:
        if not 0.0 < travel < LEAST_TURN:
            return []
        message = f"is continuous, which turns beyond its limits {limit.lower:g} to {limit.upper:g}"
        return [warning(file, subject, message, 'write type="revolute" where it must stay within them', line)]
    if not travel > 0.0:
        message = f"limits {limit.lower:g} to {limit.upper:g} leave no travel"
        return [error(file, subject, message, "give lower < upper", line)]
    if travel > MOST_TRAVEL[kind]:
        slides = kind is JointKind.PRISMATIC
        message = f"travel of {travel:.4g} {'m is beyond 5 m' if slides else 'rad is beyond four turns'}"
        return [warning(file, subject, message, "are these mm?" if slides else "are these degrees?", line)]
    return []


def _inertial(inertial: Inertial, subject: str, file: str, line: int) -> list[Finding]:
    """A real body: positive mass, positive principal moments, none above the sum of the other two."""
    if not inertial.mass > 0.0:
        return [error(file, subject, f"its mass is {inertial.mass:g} kg", FRAME_REMEDY, line)]
    low, middle, high = principal_moments(inertial)
    if low <= 0.0:
        message = f"a principal moment of inertia is {low:.3g} kg m^2"
        return [error(file, subject, message, "they are all above 0", line)]
    if low + middle < high * (1.0 - 1e-6):
        return [
            error(
                file,
                subject,
                f"principal moments {low:.3g} + {middle:.3g} < {high:.3g} kg m^2: no body has such inertia",
                "compute them from the shape; for a box m/12 (b^2 + c^2)",
                line,
            )
        ]
    if gyration(inertial, high) > LARGEST_GYRATION:
        message = f"its mass would lie {gyration(inertial, high):.3g} m from its centre by its inertia"
        return [warning(file, subject, message, "is <inertia> in kg mm^2 or g mm^2? write it in kg m^2", line)]
    return []


def principal_moments(inertial: Inertial) -> tuple[float, float, float]:
    """[kg m^2] in rising order."""
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    low, middle, high = np.linalg.eigvalsh(np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])).tolist()
    return low, middle, high
