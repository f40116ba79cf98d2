"""Checks of the URDF's units: lengths in millimetres, turns in degrees, masses in grams."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from gemelo.libraries.arm.checks.findings import Finding, Severity, error, warning
from gemelo.libraries.arm.checks.meshes import IN_MILLIMETRES
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import Inertial, Origin, UrdfModel
from gemelo.schemas.reasons import Reason, Value, because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
FARTHEST = 50.0  # [m] all joints together: in millimetres every arm above 5 cm is beyond it, in metres none
NO_LENGTH = 1e-6  # [m] below which an origin is where its parent is
MOST_TURN = 1.001 * math.tau  # [rad] of an rpy: two turns say nothing that one does not
HEAVIEST = 1000.0  # [kg] of all links: only the largest industrial arms are above
LARGEST_GYRATION = IN_MILLIMETRES  # [m] radius of gyration: beyond it no link's mass is


class Length(NamedTuple):
    """One length of a URDF: what has it, its element there, its size [m], how to write it if it is in millimetres."""

    of: Subject
    element: str
    size: float
    meant: str
    line: int


def check_units(model: UrdfModel, file: str) -> list[Finding]:
    """One finding where the whole URDF is in millimetres, else one for each length, turn and mass that is none."""
    found = list(_lengths(model, file))
    found += _turns(model, file)
    weights = [link.inertial.mass if link.inertial else 0.0 for link in model.links]
    if sum(weights) > HEAVIEST:
        heaviest = model.links[weights.index(max(weights))]
        what = because("urdf.mass.all", remedy("grams"), mass=sum(weights), link=heaviest.name, heaviest=max(weights))
        found.append(warning(file, Subject("robot"), what, line=heaviest.line))
    return found


def is_drawn_in_millimetres(model: UrdfModel) -> bool:
    """True if the usual joint's origin and the usual shape without a mesh are too long for metres, and all are far."""
    joints, shapes = [each.size for each in joint_lengths(model)], [each.size for each in shape_lengths(model)]
    usual = all(statistics.median(sizes) > IN_MILLIMETRES for sizes in (joints, shapes) if sizes)
    return usual and sum(joints) + max(shapes, default=0.0) > FARTHEST


def in_millimetres_reason(model: UrdfModel) -> tuple[Reason, int]:
    """What says so, and the line of its longest length."""
    joints, longest = list(joint_lengths(model)), max(_all_lengths(model), key=lambda each: each.size)
    element, kind, name = longest.element, longest.of.kind, longest.of.name
    thing: dict[str, Value] = {"element": element, "kind": kind, "name": name, "length": longest.size}
    if not joints:
        return because("urdf.millimetres", **thing), longest.line
    return because("urdf.millimetres.span", span=sum(each.size for each in joints), **thing), longest.line


def gyration(inertial: Inertial, highest: float) -> float:
    """[m] radius of gyration of a mass above 0 with the `highest` principal moment [kg m^2]."""
    return math.sqrt(max(0.0, highest) / inertial.mass)


def joint_lengths(model: UrdfModel) -> Iterator[Length]:
    """Of each joint's origin that is not its parent's."""
    for joint in model.joints:
        size = math.hypot(*joint.origin.xyz)
        if size > NO_LENGTH:
            yield Length(Subject("joint", joint.name), "<origin>", size, _xyz(joint.origin), joint.line)


def shape_lengths(model: UrdfModel) -> Iterator[Length]:
    """Of each box, cylinder and ball; meshes are judged for themselves."""
    for link in model.links:
        for shape in (*link.visuals, *link.collisions):
            if shape.size:
                meant = " x ".join(f"{0.001 * value:.6g}" for value in shape.size)
                yield Length(Subject("link", link.name), f"<{shape.shape}>", max(shape.size), meant, shape.line)


def _lengths(model: UrdfModel, file: str) -> Iterator[Finding]:
    if is_drawn_in_millimetres(model):
        what, line = in_millimetres_reason(model)
        whole = msgspec.structs.replace(what, remedies=(remedy("import_or_scale"),))
        yield error(file, Subject("robot"), whole, line=line)
        return
    for each in _all_lengths(model):
        if each.size > IN_MILLIMETRES:
            severity = Severity.ERROR if each.size > FARTHEST else Severity.WARNING
            mend = remedy("in_mm_then_write", text=each.meant)
            what = because("urdf.length", mend, element=each.element, length=each.size)
            yield Finding(severity, file, each.of, what, each.line)


def _all_lengths(model: UrdfModel) -> Iterator[Length]:
    yield from joint_lengths(model)
    yield from shape_lengths(model)
    for link in model.links:
        for role, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                origin, size = shape.origin, math.hypot(*shape.origin.xyz)
                yield Length(Subject("link", link.name), f"<{role}> <origin>", size, _xyz(origin), shape.line)


def _turns(model: UrdfModel, file: str) -> Iterator[Finding]:
    """Of every joint and shape that is turned by more than a turn."""
    turned = [(Subject("joint", joint.name), joint.origin, joint.line) for joint in model.joints]
    for link in model.links:
        shapes = (*link.visuals, *link.collisions)
        turned += [(Subject("link", link.name), shape.origin, shape.line) for shape in shapes]
    for subject, origin, line in turned:
        if max(map(abs, origin.rpy)) > MOST_TURN:
            written = " ".join(f"{value:.6g}" for value in origin.rpy)
            meant = " ".join(f"{math.radians(value):.6g}" for value in origin.rpy)
            what = because("urdf.rpy", remedy("in_degrees_then_write", text=f'rpy="{meant}"'), rpy=written)
            yield warning(file, subject, what, line=line)


def _xyz(origin: Origin) -> str:
    """As it would be written if it was in millimetres."""
    return f'xyz="{" ".join(f"{0.001 * value:.6g}" for value in origin.xyz)}"'
