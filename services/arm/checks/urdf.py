"""Checks of the URDF: the tree, references to links and meshes, limits, inertias."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from services.arm.checks.findings import Finding, error, warning
from services.arm.errors import suggestion
from services.arm.model.urdf import Geometry, Inertial, JointKind, UrdfJoint, UrdfLink, UrdfModel

COLLISION_REMEDY = "add a box or a cylinder, or let `gemelo collision fit --meshes` fit some"
SHAPES = ("box", "cylinder", "sphere", "mesh")
PLACEHOLDER_EFFORTS = (100.0, 300.0, 1000.0)  # what exporters write when nobody thought about it


def check_urdf(model: UrdfModel, path: Path) -> list[Finding]:
    """Everything about the URDF alone."""
    file = path.name
    findings = _tree(model, file)
    for link in model.links:
        findings += _link(link, path)
    for joint in model.joints:
        findings += _references(joint, model, file)
        if joint.kind is not JointKind.FIXED and joint.mimic is None:
            findings += _limits(joint, file)
    return findings


def _tree(model: UrdfModel, file: str) -> list[Finding]:
    """One root, every link once, every child once."""
    findings = []
    for what, names in (("link", model.link_names), ("joint", model.joint_names)):
        for name, count in Counter(names).items():
            if count > 1:
                findings.append(error(file, f'{what} "{name}"', f"is there {count} times", "names are unique"))
    children = [joint.child for joint in model.joints]
    for name, count in Counter(children).items():
        if count > 1:
            findings.append(error(file, f'link "{name}"', f"is the child of {count} joints", "a link has one parent"))
    roots = [name for name in model.link_names if name not in children]
    if len(roots) != 1:
        findings.append(error(file, "tree", f"has {len(roots)} roots ({', '.join(roots)})", "join them with a joint"))
    loose = sorted(set(model.link_names) - _connected(model, roots))
    findings += [error(file, f'link "{x}"', "is not connected to a root: its joints form a ring") for x in loose]
    return findings


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
        if link not in model.link_names:
            hint = suggestion(link, model.link_names)
            findings.append(error(file, f'joint "{joint.name}"', f'its {role} "{link}" is no link{hint}'))
    if joint.mimic is not None and joint.mimic.joint not in model.joint_names:
        hint = suggestion(joint.mimic.joint, model.joint_names)
        findings.append(error(file, f'joint "{joint.name}"', f'mimics "{joint.mimic.joint}", which is no joint{hint}'))
    return findings


def _link(link: UrdfLink, path: Path) -> list[Finding]:
    subject = f'link "{link.name}"'
    findings = [] if link.inertial is None else _inertial(link.inertial, subject, path.name)
    for role, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        for geometry in shapes:
            findings += _geometry(geometry, role, subject, path)
    if link.visuals and not link.collisions:
        message = "can be seen but not touched: it has no <collision>"
        findings.append(warning(path.name, subject, message, COLLISION_REMEDY))
    return findings


def _geometry(geometry: Geometry, role: str, subject: str, path: Path) -> list[Finding]:
    if geometry.shape not in SHAPES:
        remedy = "write <cylinder>" if geometry.shape == "capsule" else f"use {', '.join(SHAPES)}"
        return [error(path.name, subject, f"<{geometry.shape}> in <{role}> is not URDF and would be ignored", remedy)]
    if geometry.mesh is None:
        return []
    if geometry.mesh.startswith("package://"):
        return [_package(geometry.mesh, subject, path)]
    if not (path.parent / geometry.mesh.removeprefix("file://")).is_file():
        near = suggestion(geometry.mesh, [str(p.relative_to(path.parent)) for p in path.parent.glob("**/*.*")])
        return [error(path.name, subject, f'mesh "{geometry.mesh}" is not there{near}', "put the file there")]
    return []


def _package(reference: str, subject: str, path: Path) -> Finding:
    """A package:// path means nothing without ROS: say where the file is, if it is in this folder."""
    name = reference.rsplit("/", 1)[-1]
    found = sorted(path.parent.rglob(name))
    remedy = (
        f'write filename="{found[0].relative_to(path.parent)}"'
        if found
        else f"put {name} into this folder and write its path relative to {path.name}"
    )
    return error(path.name, subject, f'mesh "{reference}" is a ROS package path', remedy)


def _limits(joint: UrdfJoint, file: str) -> list[Finding]:
    subject, limit = f'joint "{joint.name}"', joint.limit
    if limit is None:
        return [error(file, subject, "has no <limit>", "give lower, upper, effort and velocity")]
    findings = []
    if joint.kind is not JointKind.CONTINUOUS and not limit.lower < limit.upper:
        findings.append(
            error(file, subject, f"limits {limit.lower:g} to {limit.upper:g} leave no travel", "give lower < upper")
        )
    for name, value in (("velocity", limit.velocity), ("effort", limit.effort)):
        if not value > 0.0:
            findings.append(error(file, subject, f"its {name} limit is {value:g}", "give a value above 0"))
    if limit.effort in PLACEHOLDER_EFFORTS:
        findings.append(
            warning(
                file, subject, f"effort {limit.effort:g} looks like an exporter's placeholder", "give the motor's own"
            )
        )
    return findings


def _inertial(inertial: Inertial, subject: str, file: str) -> list[Finding]:
    """A real body: positive mass, positive principal moments, none above the sum of the other two."""
    if not inertial.mass > 0.0:
        return [error(file, subject, f"its mass is {inertial.mass:g} kg", "give a mass above 0")]
    ixx, ixy, ixz, iyy, iyz, izz = inertial.inertia
    low, middle, high = np.linalg.eigvalsh(np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])).tolist()
    if low <= 0.0:
        return [error(file, subject, f"a principal moment of inertia is {low:.3g} kg m^2", "they are all above 0")]
    if low + middle < high * (1.0 - 1e-6):
        return [
            error(
                file,
                subject,
                f"principal moments {low:.3g} + {middle:.3g} < {high:.3g} kg m^2: no body has such inertia",
                "compute them from the shape; for a box m/12 (b^2 + c^2)",
            )
        ]
    return []
