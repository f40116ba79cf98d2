"""Repairs with one answer in the links of a source: mesh files, their sizes, inertias, missing drawings."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from gemelo.libraries.arm.checks.findings import Finding, error, note
from gemelo.libraries.arm.checks.meshes import SMALLEST, Facts, MeshFacts, facts_of, link_volume
from gemelo.libraries.arm.checks.units import LARGEST_GYRATION, gyration
from gemelo.libraries.arm.checks.urdf import UNTOUCHED, principal_moments
from gemelo.libraries.arm.model.urdf import UrdfLink
from gemelo.libraries.robot_import.mended import Mended, links_of, meshes_of, subject_of
from gemelo.libraries.robot_import.questions import Questions, yes_or_no
from gemelo.schemas.reasons import Reason

MOST_NAMED = 3


def references(mended: Mended) -> None:
    """The files that meshes mean. A missing one is an error, but for one to look at of a link whose collision shapes
    are all there: these are drawn."""
    by_package: dict[str, int] = {}
    missing: set[tuple[ET.Element, str]] = set()  # most are in <visual> and in <collision>
    for link, _, item, _, mesh in meshes_of(mended):
        reference = mesh.get("filename", "")
        found = _found(mended, link, mesh, reference)
        if found is None and reference and (link, reference) not in missing:
            missing.add((link, reference))
            message = f'mesh "{reference}" is not there'
            if item.tag == "visual" and _touches_wholly(mended, link):
                link.remove(item)
                mended.warn(mesh, subject_of(link), message, "left out: it is drawn with its <collision>")
                continue
            message += mended.source.near(reference)
            mended.fail(mesh, subject_of(link), message, f"put it below {mended.source.root}")
        elif found is not None:
            mended.files[reference] = found
            if reference.startswith("package://"):
                package = reference.split("/")[2]
                by_package[package] = by_package.get(package, 0) + 1
    for package, count in by_package.items():
        message = f"{count} meshes are named by the ROS package path package://{package}"
        mended.notes.append(note(mended.source.label, "meshes", message, "relative paths, the files copied"))


def _found(mended: Mended, link: ET.Element, mesh: ET.Element, reference: str) -> Path | None:
    """The file; one of the same name in another format where that is the only one."""
    found = mended.source.find(reference) if reference else None
    if found is not None or not reference:
        return found
    other = mended.source.in_another_format(reference)
    if other is not None and reference not in mended.files:
        message = f'mesh "{reference}" is not there, but {other.name} is'
        mended.say(mesh, subject_of(link), message, f'filename="{other.name}"')
    return other


def _touches_wholly(mended: Mended, link: ET.Element) -> bool:
    """True if it has collision shapes, and each mesh of them is there and can be read."""
    shapes = [item.find("geometry/mesh") for item in link.findall("collision")]
    files = [mended.source.find(mesh.get("filename", "")) for mesh in shapes if mesh is not None]
    return bool(shapes) and all(file is not None and isinstance(facts_of(file), MeshFacts) for file in files)


def unreadable(mended: Mended) -> None:
    """A mesh to look at that cannot be read is left out where the collision shapes can."""
    for link, _, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, Reason) and item.tag == "visual" and _touches_wholly(mended, link):
            link.remove(item)
            message = f'mesh "{geometry.mesh}": {known}'
            mended.warn(mesh, subject_of(link), message, "left out: it is drawn with its <collision>")


def flat(mended: Mended) -> None:
    """A mesh without volume is drawn nowhere and fitted to nothing."""
    for link, _, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and known.is_flat:
            message = f'mesh "{geometry.mesh}" in <{item.tag}> bounds no volume'
            link.remove(item)
            mended.say(mesh, subject_of(link), message, "left out")


def tiny(mended: Mended) -> None:
    """A mesh of less than two millimetres is a placeholder; or, where it is scaled, scaled too much."""
    for link, _, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        scale = max(map(abs, geometry.scale))
        if not isinstance(known, MeshFacts) or not 0.0 < known.longest * scale < SMALLEST:
            continue
        message = f'mesh "{geometry.mesh}" is {1000.0 * known.longest * scale:.3g} mm long'
        if scale == 1.0:
            link.remove(item)
            mended.say(mesh, subject_of(link), f"{message}: it stands for nothing", "left out")
        else:
            line = mended.xml.lines.get(mesh, 0)
            remedy = f'correct scale="{mesh.get("scale")}"'
            mended.errors.append(error(mended.source.label, subject_of(link), message, remedy, line))


def frames(mended: Mended) -> None:
    """Leaves out the inertia of a link without mass."""
    for link, model in links_of(mended):
        inertial = link.find("inertial")
        if inertial is not None and model.inertial is not None and model.inertial.mass == 0.0:
            link.remove(inertial)
            mended.say(inertial, subject_of(link), "its mass is 0 kg: it is a mere frame", "<inertial> left out")


def inertias(mended: Mended) -> None:
    """One that no body has becomes that of the meshes, of even density and of the same mass."""
    for link, model in links_of(mended):
        inertial, known = link.find("inertial"), model.inertial
        if inertial is None or known is None or not known.mass > 0.0:
            continue
        low, middle, high = principal_moments(known)
        far = gyration(known, high) > LARGEST_GYRATION
        if low > 0.0 and low + middle >= high * (1.0 - 1e-6) and not far:
            continue
        unit = " of that mass: they are in another unit" if far else ""
        message = f"its principal moments {low:.3g}, {middle:.3g}, {high:.3g} kg m^2 are of no body{unit}"
        link.remove(inertial)
        even = _even_density(model, known.mass, mended.facts)
        if even is not None:
            link.insert(0, even)
            mended.xml.lines[even] = mended.xml.lines.get(inertial, 0)
        remedy = "left out" if even is None else f"that of its mesh at {known.mass:g} kg of even density"
        mended.say(inertial, subject_of(link), message, remedy)


def unseen(mended: Mended) -> None:
    """A link with collision meshes alone is drawn with them."""
    for link in mended.xml.root.findall("link"):
        if link.find("visual") is not None:
            continue
        collisions = link.findall("collision")
        for collision in collisions:
            visual = ET.fromstring(ET.tostring(collision))
            visual.tag = "visual"
            link.insert(0, visual)
        if collisions:
            mended.say(
                collisions[0], subject_of(link), "has a <collision>, but no <visual>", "drawn with the same shape"
            )


def shapeless(mended: Mended) -> list[Finding]:
    """A robot without any shape, or a length to draw: an error for who would import it."""
    if any(link.find("visual") is not None for link in mended.xml.root.findall("link")):
        return []
    message = "no link has a <visual> or <collision>: nothing could be drawn, nothing would ever touch"
    return [error(mended.source.label, "robot", message, "give the links meshes, boxes or cylinders")]


def _even_density(link: UrdfLink, mass: float, facts: Facts) -> ET.Element | None:
    """<inertial> of a link with one visual mesh; None for others."""
    volume = link_volume(link, facts)
    known = facts(link.visuals[0]) if len(link.visuals) == 1 else None
    if not volume or not isinstance(known, MeshFacts) or len({abs(value) for value in link.visuals[0].scale}) != 1:
        return None
    scale, origin = abs(link.visuals[0].scale[0]), link.visuals[0].origin
    if any(origin.rpy):
        return None
    moments = [mass / known.volume * scale**2 * value for value in known.inertia]
    center = [place + scale * value for place, value in zip(origin.xyz, known.center, strict=True)]
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=" ".join(f"{value:.6g}" for value in center), rpy="0 0 0")
    ET.SubElement(element, "mass", value=f"{mass:.6g}")
    names = {"ixx": 0, "ixy": 1, "ixz": 2, "iyy": 4, "iyz": 5, "izz": 8}
    ET.SubElement(element, "inertia", {name: f"{moments[place]:.6g}" for name, place in names.items()})
    return element


def untouched(mended: Mended, questions: Questions) -> None:
    """Links that are drawn and have no <collision>: as the owner has it where others have one, which is said; where no
    link has one, all get shapes."""
    bare = [(element, link) for element, link in links_of(mended) if link.visuals and not link.collisions]
    if not bare:
        return
    names = ", ".join(link.name for _, link in bare[:MOST_NAMED])
    names += f" and {len(bare) - MOST_NAMED} more" if len(bare) > MOST_NAMED else ""
    has_some = any(link.collisions for link in mended.model.links)
    question = f"fit collision shapes to what is only drawn ({names})?"
    mended.fits_bare = not has_some or questions.ask("shapes_for_drawn", question, "no", yes_or_no)
    for element, _ in bare if not mended.fits_bare else ():
        remedy = 'nothing will touch it; shapes_for_drawn = "yes" in --answers fits shapes to it'
        mended.warn(element, subject_of(element), UNTOUCHED, remedy)
    if mended.fits_bare:
        element, _ = bare[0]
        message = f"{len(bare)} links are drawn and have no <collision> ({names})"
        mended.say(element, subject_of(element), message, "shapes are fitted to what is drawn")


def own_collisions(mended: Mended) -> None:
    """Collision meshes of a person's own, to which shapes are fitted."""
    own = [(element, link) for element, link in links_of(mended) if any(each.mesh for each in link.collisions)]
    other = [each for each in own if {s.mesh for s in each[1].collisions} != {s.mesh for s in each[1].visuals}]
    if other:
        element, _ = other[0]
        message = f"{len(other)} links have <collision> meshes of their own"
        mended.say(element, subject_of(element), message, "collision shapes are fitted to these, not to the <visual>")
