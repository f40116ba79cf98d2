"""The unit of meshes: metres, millimetres, centimetres or inches, by the distances of the joints that they span.

A link reaches from its joint to the next one, and its mesh with it. Meshes that are written with one scale are in one
unit, since one program has exported them.
"""

from __future__ import annotations

import math
import statistics
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gemelo.libraries.arm.checks.meshes import IN_MILLIMETRES, MeshFacts
from gemelo.libraries.arm.model.urdf import Geometry, UrdfLink, UrdfModel
from gemelo.libraries.robot_import.link_boxes import carried_by, corners_of, longest_joint, placed, pose_of
from gemelo.libraries.robot_import.mended import Mended, meshes_of, subject_of
from gemelo.schemas.reasons import Value, because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
UNITS = {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254}  # [m]
AS_WRITTEN = "as_written"
PLAIN = (0.4, 4.0)  # how often the distance of its joints a mesh is long, as written: between them nothing is wrong
USUAL = 1.1  # times that a mesh is as long as its joints are apart
FARTHEST, APART = math.log(3.5), math.log(1.6)  # from that in the right unit; and less than in every other unit
LONG = 0.25  # of the longest distance: a link whose joints are nearer to one another says nothing
ALONE = 12.0  # times the distance of its joints that one mesh among others is too long
LEAF = (0.1, 5.0)  # of the longest distance of joints: the length of a mesh that spans none


@dataclass(frozen=True)
class DrawnMesh:
    """One mesh of a link in a source."""

    link: ET.Element
    model: UrdfLink
    item: ET.Element  # <visual> or <collision>
    geometry: Geometry
    mesh: ET.Element


def mesh_units(mended: Mended) -> None:
    """Gives meshes in another unit their scale where one unit fits; asks where none or two do."""
    groups: dict[tuple[str, float, bool], list[DrawnMesh]] = {}
    for link, model, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and any(geometry.scale):
            names_unit = (geometry.mesh or "").lower().endswith(".dae")
            key = (item.tag, max(map(abs, geometry.scale)), names_unit)
            groups.setdefault(key, []).append(DrawnMesh(link, model, item, geometry, mesh))
    for (tag, scale, _), drawn in groups.items():
        _judge(mended, tag, scale, drawn)


def _judge(mended: Mended, tag: str, scale: float, drawn: Sequence[DrawnMesh]) -> None:
    """Of all meshes with one scale; then of each that is far too long among them."""
    model = mended.model
    ratio = _ratio(mended, model, drawn, scale)
    if ratio is not None and not PLAIN[0] <= ratio(scale) <= PLAIN[1]:
        _settle(mended, tag, scale, drawn, ratio)
        return
    for each in drawn:
        own = _ratio(mended, model, [each], scale)
        if own is not None and own(scale) > ALONE:
            _settle(mended, tag, scale, [each], own)
        elif own is None and _length(mended, each) * scale > max(IN_MILLIMETRES, LEAF[1] * longest_joint(model)):
            _settle(mended, tag, scale, [each], None)


def _settle(
    mended: Mended, tag: str, scale: float, drawn: Sequence[DrawnMesh], ratio: Callable[[float], float] | None
) -> None:
    """Writes the one unit that fits, or asks for it."""
    first = drawn[0]
    span = longest_joint(mended.model)
    units = _fitting(ratio) if ratio is not None else _fitting_leaf(_length(mended, first), span)
    length = _length(mended, first) * scale
    size: dict[str, Value] = {"mesh": first.geometry.mesh or "", "length": length, "span": span}
    long = because("mend.mesh.long", **size)
    if len(drawn) > 1:
        long = because("mend.mesh.long.several", **size, count=len(drawn), tag=tag)
    if len(units) != 1:
        fit = because("mend.mesh.units", long, units=tuple(units)) if units else because("mend.mesh.no_unit", long)
        key, words = f"{tag}_mesh_unit", [*UNITS, AS_WRITTEN]
        mended.sized |= {each.geometry.mesh or "" for each in drawn}
        chosen = mended.choose(key, first.mesh, subject_of(first.link), fit, words)
        if chosen is None or chosen == AS_WRITTEN:
            return
        units = [chosen]
    (unit,) = units
    for each in drawn:
        factor = UNITS[unit] / scale
        each.mesh.set("scale", " ".join(f"{factor * value:.9g}" for value in each.geometry.scale))
    mend = remedy("written", text=f'scale="{first.mesh.get("scale")}"')
    mended.say(first.mesh, subject_of(first.link), because("mend.mesh.unit", long, mend, unit=unit))


def _fitting(ratio: Callable[[float], float]) -> list[str]:
    """The unit in which the meshes are about as long as their joints are apart; two where it could be either."""
    far = {unit: abs(math.log(ratio(metres) / USUAL)) for unit, metres in UNITS.items() if ratio(metres) > 0.0}
    if not far:
        return []
    best, *others = sorted(far, key=lambda unit: far[unit])
    if far[best] > FARTHEST:
        return []
    return [best, *(other for other in others if far[other] < far[best] + APART)]


def _fitting_leaf(length: float, span: float) -> list[str]:
    """The units in which a mesh that spans no joints has a length that belongs to the arm; millimetres where no joint
    is apart from another."""
    if not span:
        return ["mm"]
    return [unit for unit, metres in UNITS.items() if LEAF[0] * span <= length * metres <= LEAF[1] * span]


def _ratio(
    mended: Mended, model: UrdfModel, drawn: Sequence[DrawnMesh], scale: float
) -> Callable[[float], float] | None:
    """How many times the distance of its joints the meshes of a link reach along it, of the usual link, by the metres
    of a unit; None where no link has joints apart."""
    least = LONG * longest_joint(model)
    by_link: dict[str, list[DrawnMesh]] = {}
    for each in drawn:
        by_link.setdefault(each.model.name, []).append(each)
    spans: list[tuple[float, list[tuple[float, float, float]]]] = []  # distance [m]; starts and extents along it
    for meshes in by_link.values():
        farthest = max((np.array(j.origin.xyz) for j in carried_by(meshes[0].model, model)), key=_norm, default=None)
        if farthest is None or _norm(farthest) < max(least, 1e-6):
            continue
        along = farthest / _norm(farthest)
        spans.append((_norm(farthest), [_reach(mended, each, along) for each in meshes]))
    if not spans:
        return None

    def ratio(metres: float) -> float:
        unit = metres / scale
        found = []
        for distance, reaches in spans:
            low = min(start + unit * first for start, first, _ in reaches)
            high = max(start + unit * most for start, _, most in reaches)
            found.append((high - low) / distance)
        return statistics.median(found)

    return ratio


def _reach(mended: Mended, each: DrawnMesh, along: np.ndarray) -> tuple[float, float, float]:
    """[m] along a direction: of its origin, and from there the least and the most of the mesh as it is scaled now."""
    corners = corners_of(each.geometry, mended.facts)
    assert corners is not None
    place, turn = pose_of(each.geometry)
    heights = placed(corners, ((0.0, 0.0, 0.0), turn)) @ along
    return float(np.dot(place, along)), float(heights.min()), float(heights.max())


def _length(mended: Mended, each: DrawnMesh) -> float:
    """In the file's unit."""
    known = mended.facts(each.geometry)
    return known.longest if isinstance(known, MeshFacts) else 0.0


def _norm(vector: np.ndarray) -> float:
    return float(np.linalg.norm(vector))
