"""Places of meshes and masses: near the joints of their link, or in the frame of the assembly, or beside it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.checks.meshes import IN_MILLIMETRES
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_rpy, inverse, to_rpy
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.urdf import Geometry, UrdfLink, UrdfModel
from gemelo.libraries.robot_import.link_boxes import (
    Box,
    between,
    box_of,
    diagonal,
    distance_to,
    joints_at,
    longest_joint,
)
from gemelo.libraries.robot_import.mended import Mended, links_of, subject_of, with_remedy
from gemelo.schemas.reasons import because, remedy

Array = NDArray[np.float64]
LEFT_THERE = remedy("left_there")

# Tuning constants: chosen, where a line does not say measured or standard.
AWAY = (
    0.5  # of the longest distance of joints, and of the shape's own diagonal: a shape farther from all joints is away
)
NEAR = 0.25  # of the longest distance of joints: a shape nearer to them belongs to them
BESIDE, BESIDE_LEAST = 0.25, 0.02  # of the visual's diagonal, and [m]: a collision shape farther from it is beside it
MASS_AWAY, MASS_LEAST = 0.5, 0.05  # the same of a centre of mass outside what the link looks like
ALIKE = 0.2  # of their diagonals, by which two shapes of one thing may differ
AS_WRITTEN = "as_written"
MILLIMETRE = 0.001  # [m]


def mesh_places(mended: Mended) -> None:
    """Meshes that an exporter has left in the frame of the assembly are put where their link is; others that are far
    from all joints of their link are asked for."""
    model = mended.model
    least = AWAY * longest_joint(model)
    boxes = {link.name: box_of(_meshed(link), mended.facts) for link in model.links}
    away = [
        link
        for link in model.links
        if (box := boxes[link.name]) is not None and _gap(box, link, model) > max(least, AWAY * diagonal(box)) > 0.0
    ]
    if not away:
        return
    back = {name: inverse(pose) for name, pose in link_transforms(model, {}).items()}
    if _fits_the_assembly(mended, model, away, back):
        _move_back(mended, model, away, back)
        return
    for link in away:
        element = next(each for each in mended.xml.root.findall("link") if each.get("name") == link.name)
        box = boxes[link.name]
        assert box is not None
        away_from = because("mend.place.away", gap=_gap(box, link, model))
        if mended.choose("mesh_places", element, subject_of(element), away_from, [AS_WRITTEN]) is None:
            continue
        mended.warn(element, subject_of(element), with_remedy(away_from, LEFT_THERE))


def _fits_the_assembly(mended: Mended, model: UrdfModel, away: list[UrdfLink], back: Mapping[str, Rigid]) -> bool:
    """True if all meshes are at their joints where each is taken from the root's frame into its link's."""
    near = NEAR * longest_joint(model)
    for link in model.links:
        box = box_of(_meshed(link), mended.facts, _outer(back.get(link.name)))
        if box is not None and _gap(box, link, model) > max(near, NEAR * diagonal(box)):
            return False
    return all(link.name in back for link in away)


def _outer(pose: Rigid | None) -> Callable[[Geometry], Rigid] | None:
    return None if pose is None else lambda _: pose


def _move_back(mended: Mended, model: UrdfModel, away: list[UrdfLink], back: Mapping[str, Rigid]) -> None:
    """Gives every mesh the origin that takes it from the root's frame into its link's."""
    names = {link.name for link in away}
    for element, link in links_of(mended):
        pose = back.get(link.name)
        if pose is None or not (np.any(pose[0]) or np.any(pose[1][:3])):
            continue
        box = box_of(_meshed(link), mended.facts)
        written = ""
        for item, shape in _shapes(element, link):
            if shape.mesh is not None:
                written = set_origin(item, compose(pose, (shape.origin.xyz, from_rpy(*shape.origin.rpy))))
        if box is not None and written:
            mend = remedy("written", text=f"<origin {written}/>")
            what = because("mend.place.assembly", mend)
            if link.name in names:
                what = because("mend.place.assembly.away", mend, gap=_gap(box, link, model))
            mended.say(element, subject_of(element), what)


def collisions_beside(mended: Mended) -> None:
    """A collision shape that stands beside what it is of is put there where it is the same thing, else asked for."""
    for element, link in links_of(mended):
        look, touch = box_of(link.visuals, mended.facts), box_of(link.collisions, mended.facts)
        if look is None or touch is None:
            continue
        gap = between(look, touch)
        if gap <= max(BESIDE_LEAST, BESIDE * diagonal(look)):
            continue
        item = element.findall("collision")[0]
        if len(link.visuals) == len(link.collisions) == 1 and _are_alike(mended, *link.visuals, *link.collisions):
            origin = link.visuals[0].origin
            written = set_origin(item, (origin.xyz, from_rpy(*origin.rpy)))
            mend = remedy("written_as_visual", text=f"<origin {written}/>")
            mended.say(item, subject_of(element), because("mend.place.beside.alike", mend, gap=gap))
            continue
        beside = because("mend.place.beside", gap=gap)
        if mended.choose("collision_places", item, subject_of(element), beside, [AS_WRITTEN]) is not None:
            mended.warn(item, subject_of(element), with_remedy(beside, LEFT_THERE))


def masses_away(mended: Mended) -> None:
    """A centre of mass far outside its link is put back by the frame of the assembly or by its unit, else into the
    middle of what the link looks like."""
    back = {name: inverse(pose) for name, pose in link_transforms(mended.model, {}).items()}
    for element, link in links_of(mended):
        look, inertial = box_of(link.visuals, mended.facts), element.find("inertial")
        if look is None or inertial is None or link.inertial is None:
            continue
        least = max(MASS_LEAST, MASS_AWAY * diagonal(look))
        place = link.inertial.origin.xyz
        gap = distance_to(look, place)
        if gap <= least:
            continue
        pose = (place, from_rpy(*link.inertial.origin.rpy))
        x, y, z = (0.5 * (look[0] + look[1])).tolist()
        tries: list[tuple[str, Rigid]] = [("mend.mass.assembly", compose(back.get(link.name, IDENTITY), pose))]
        if np.linalg.norm(place) > IN_MILLIMETRES:
            smaller = (MILLIMETRE * place[0], MILLIMETRE * place[1], MILLIMETRE * place[2])
            tries.append(("mend.mass.millimetres", (smaller, pose[1])))
        tries.append(("mend.mass.middle", ((x, y, z), pose[1])))
        code, there = next(each for each in tries if distance_to(look, each[1][0]) <= NEAR * least)
        mend = remedy("written", text=f"<origin {set_origin(inertial, there)}/>")
        mended.say(inertial, subject_of(element), because(code, mend, gap=gap))


def set_origin(item: ET.Element, pose: Rigid) -> str:
    """Writes the <origin> of an element anew, and returns its attributes as written."""
    for origin in item.findall("origin"):
        item.remove(origin)
    written = {"xyz": _words(pose[0]), "rpy": _words(to_rpy(pose[1]))}
    item.insert(0, ET.Element("origin", written))
    return " ".join(f'{key}="{value}"' for key, value in written.items())


def _words(values: tuple[float, ...]) -> str:
    return " ".join(f"{round(value, 9) + 0.0:.9g}" for value in values)


def _gap(box: Box, link: UrdfLink, model: UrdfModel) -> float:
    """[m] from the box to the nearest joint of its link; 0 for a link without any."""
    return min((distance_to(box, point.tolist()) for point in joints_at(link, model)), default=0.0)


def _meshed(link: UrdfLink) -> list[Geometry]:
    return [shape for shape in link.visuals or link.collisions if shape.mesh is not None]


def _shapes(element: ET.Element, link: UrdfLink) -> Iterator[tuple[ET.Element, Geometry]]:
    yield from zip(element.findall("visual"), link.visuals, strict=True)
    yield from zip(element.findall("collision"), link.collisions, strict=True)


def _are_alike(mended: Mended, one: Geometry, other: Geometry) -> bool:
    """True if the two are of about one size along each of their own axes."""
    boxes = [
        box_of([shape], mended.facts, lambda each: inverse((each.origin.xyz, from_rpy(*each.origin.rpy))))
        for shape in (one, other)
    ]
    if boxes[0] is None or boxes[1] is None:
        return False
    sides = [box[1] - box[0] for box in boxes if box is not None]
    return bool(np.abs(sides[0] - sides[1]).max() <= ALIKE * np.linalg.norm(sides[0]))
