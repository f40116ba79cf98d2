"""Checks of the URDF: the tree, references to links and meshes, limits, inertias."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.checks.units import LARGEST_GYRATION, check_units, gyration
from gemelo.libraries.arm.errors import Subject, nearest, nearest_name
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
from gemelo.schemas.reasons import Reason, Remedy, because, remedy

UNTOUCHED = because("urdf.link.untouched")
MESHES = (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
SHAPES = ("box", "cylinder", "sphere", "mesh")
MOST_TRAVEL = {JointKind.REVOLUTE: 4.01 * math.tau, JointKind.PRISMATIC: 5.0}  # [rad] or [m]
LEAST_TURN = 0.99 * math.tau  # [rad] of a continuous joint: limits of a whole turn say nothing
MOST_VELOCITY = {JointKind.REVOLUTE: 50.0, JointKind.CONTINUOUS: 50.0, JointKind.PRISMATIC: 10.0}  # [rad/s] or [m/s]
LEADER = remedy("name_the_leader")
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
    return error(file, fault.of, fault.what, line=fault.line)


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
                twice = because("urdf.name.twice", remedy("rename_or_remove"), count=len(found))
                findings.append(_at(found, file, Subject(what, name), twice))
    above = defaultdict[str, list[UrdfJoint]](list)
    for joint in model.joints:
        above[joint.child].append(joint)
    for name, joints in above.items():
        if len(joints) > 1 and name:
            several = because("urdf.link.parents", remedy("one_parent"), count=len(joints), joints=_names(joints))
            findings.append(_at([joint.line for joint in joints], file, Subject("link", name), several))
    roots = [link for link in model.links if link.name not in above]
    if len(roots) > 1:
        links = tuple(root.name for root in roots)
        several = because("urdf.roots", remedy("join_or_remove"), count=len(roots), links=links)
        findings.append(_at([root.line for root in roots], file, Subject("tree"), several))
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
        what = because("urdf.ring", remedy("open_the_ring"), joints=_names(ring))
        yield _at([joint.line for joint in ring], file, Subject("link", link), what)


def _at(lines: list[int], file: str, subject: Subject, what: Reason) -> Finding:
    """An error in several lines."""
    first, *others = sorted(set(lines))
    return replace(error(file, subject, what, line=first), also=tuple(others))


def _names(joints: list[UrdfJoint]) -> tuple[str, ...]:
    return tuple(joint.name for joint in joints)


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
            near = nearest(link, model.link_names)
            what = because("urdf.joint.no_link", near, remedy("name_a_link", role=role), role=role, link=link)
            findings.append(error(file, Subject("joint", joint.name), what, line=joint.line))
    return [*findings, *_mimic(joint, model, file)]


def _mimic(joint: UrdfJoint, model: UrdfModel, file: str) -> list[Finding]:
    """A joint follows one that has a motor of its own."""
    if joint.mimic is None or joint.kind is JointKind.FIXED:
        return []
    subject, name = Subject("joint", joint.name), joint.mimic.joint
    if name not in model.joint_names:
        near = nearest(name, model.joint_names)
        return [error(file, subject, because("urdf.mimic.none", near, LEADER, leader=name), line=joint.line)]
    leader = model.joint(name)
    if leader.kind is JointKind.FIXED or leader.mimic is not None:
        what = because("urdf.mimic.follows", LEADER, leader=name)
        if leader.kind is JointKind.FIXED:
            what = because("urdf.mimic.fixed", LEADER, leader=name)
        if name == joint.name:
            what = because("urdf.mimic.itself", LEADER)
        return [error(file, subject, what, line=joint.line)]
    reach = follower_range(joint, leader)
    if reach is None:
        return []
    mend = remedy("correct_limit_or_mimic", joint=name)
    if reach.narrow is not None:
        mend = remedy("narrow_limits", joint=name, lower=reach.narrow[0], upper=reach.narrow[1])
    what = because(
        "urdf.mimic.beyond", mend, leader=name, low=reach.low, high=reach.high, lower=reach.lower, upper=reach.upper
    )
    made = error if reach.narrow is None else warning
    return [made(file, subject, what, line=joint.line)]


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
    subject = Subject("link", link.name)
    findings = [] if link.inertial is None else _inertial(link.inertial, subject, path.name, link.line)
    for role, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for geometry in shapes:
            if has_meshes or geometry.mesh is None:
                findings += _geometry(geometry, role, subject, path)
    if has_meshes and link.visuals and not link.collisions:
        what = because("urdf.link.untouched", remedy("add_collision"))
        findings.append(warning(path.name, subject, what, line=link.line))
    return findings


def _geometry(geometry: Geometry, role: str, subject: Subject, path: Path) -> list[Finding]:
    if geometry.shape == NO_SHAPE:
        return []
    if geometry.shape not in SHAPES:
        mend = remedy("write_line", text="<cylinder>") if geometry.shape == "capsule" else remedy("use", names=SHAPES)
        what = because("urdf.shape.unknown", mend, shape=geometry.shape, role=role)
        return [error(path.name, subject, what, line=geometry.line)]
    if geometry.mesh is None:
        return []
    if geometry.mesh.startswith("package://"):
        return [_package(geometry.mesh, subject, path, geometry.line)]
    if not (path.parent / geometry.mesh.removeprefix("file://")).is_file():
        near = _near_mesh(geometry.mesh, path.parent)
        what = because("mesh.none", *near, remedy("put_file_there"), mesh=geometry.mesh)
        return [error(path.name, subject, what, line=geometry.line)]
    return []


def _near_mesh(reference: str, folder: Path) -> tuple[Remedy, ...]:
    """The file that may be meant: one that differs in folder or ending alone, else one of a like name."""
    files = [each for each in folder.glob("**/*") if each.suffix.lower() in MESHES]
    same = [each for each in files if each.stem.lower() == Path(reference).stem.lower()]
    if same:
        return (remedy("did_you_mean", name=str(same[0].relative_to(folder))),)
    near = nearest_name(Path(reference).name, [each.name for each in files])
    found = (remedy("did_you_mean", name=str(each.relative_to(folder))) for each in files if each.name == near)
    return tuple(islice(found, 1))


def _package(reference: str, subject: Subject, path: Path, line: int) -> Finding:
    """A package:// path means nothing without ROS: say where the file is, if it is in this folder."""
    name = reference.rsplit("/", 1)[-1]
    found = sorted(path.parent.rglob(name))
    mend = (
        remedy("write_line", text=f'filename="{found[0].relative_to(path.parent)}"')
        if found
        else remedy("put_into_folder", name=name, file=path.name)
    )
    return error(path.name, subject, because("mesh.package", mend, mesh=reference), line=line)


def _limits(joint: UrdfJoint, file: str) -> list[Finding]:
    subject, limit, line = Subject("joint", joint.name), joint.limit, joint.line
    if limit is None:
        return [error(file, subject, because("urdf.limit.none", remedy("give_limits")), line=line)]
    findings = _travel(joint.kind, limit, subject, file, line)
    for name, value in (("velocity", limit.velocity), ("effort", limit.effort)):
        if not value > 0.0:
            what = because("urdf.limit.zero", remedy("above_zero"), quantity=name, value=value)
            findings.append(error(file, subject, what, line=line))
    if limit.velocity > MOST_VELOCITY[joint.kind]:
        slides = joint.kind is JointKind.PRISMATIC
        mend, unit = (remedy("mm_per_s"), "m/s") if slides else (remedy("degrees_per_s"), "rad/s")
        what = because("urdf.limit.velocity", mend, value=limit.velocity, unit=unit)
        findings.append(warning(file, subject, what, line=line))
    if limit.effort in PLACEHOLDER_EFFORTS:
        what = because("urdf.limit.effort", remedy("motors_own"), value=limit.effort)
        findings.append(warning(file, subject, what, line=line))
    return findings


def _travel(kind: JointKind, limit: Limit, subject: Subject, file: str, line: int) -> list[Finding]:
    travel = limit.upper - limit.lower
    if kind is JointKind.CONTINUOUS:
        if not 0.0 < travel < LEAST_TURN:
            return []
        what = because("urdf.limit.continuous", remedy("make_revolute"), lower=limit.lower, upper=limit.upper)
        return [warning(file, subject, what, line=line)]
    if not travel > 0.0:
        what = because("urdf.limit.no_travel", remedy("lower_below_upper"), lower=limit.lower, upper=limit.upper)
        return [error(file, subject, what, line=line)]
    if travel > MOST_TRAVEL[kind]:
        what = because("urdf.travel.turns", remedy("degrees"), travel=travel)
        if kind is JointKind.PRISMATIC:
            what = because("urdf.travel.metres", remedy("millimetres"), travel=travel)
        return [warning(file, subject, what, line=line)]
    return []


def _inertial(inertial: Inertial, subject: Subject, file: str, line: int) -> list[Finding]:
    """A real body: positive mass, positive principal moments, none above the sum of the other two."""
    if not inertial.mass > 0.0:
        what = because("urdf.mass", remedy("leave_inertial_out"), mass=inertial.mass)
        return [error(file, subject, what, line=line)]
    low, middle, high = principal_moments(inertial)
    if low <= 0.0:
        what = because("urdf.inertia.negative", remedy("all_above_zero"), value=low)
        return [error(file, subject, what, line=line)]
    if low + middle < high * (1.0 - 1e-6):
        what = because("urdf.inertia.no_body", remedy("compute_inertia"), low=low, middle=middle, high=high)
        return [error(file, subject, what, line=line)]
    if (radius := gyration(inertial, high)) > LARGEST_GYRATION:
        what = because("urdf.inertia.far", remedy("inertia_in_metres"), radius=radius)
        return [warning(file, subject, what, line=line)]
    return []


def principal_moments(inertial: Inertial) -> tuple[float, float, float]:
    """[kg m^2] in rising order."""
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    low, middle, high = np.linalg.eigvalsh(np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])).tolist()
    return low, middle, high
