"""Repairs with one answer in the links of a source: mesh files, their sizes, inertias, missing drawings."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from gemelo.libraries.arm.checks.findings import Finding, error, note
from gemelo.libraries.arm.checks.meshes import SMALLEST, Facts, MeshFacts, facts_of, link_volume
from gemelo.libraries.arm.checks.units import LARGEST_GYRATION, gyration
from gemelo.libraries.arm.checks.urdf import UNTOUCHED, principal_moments
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import UrdfLink
from gemelo.libraries.robot_import.mended import LEFT_OUT, Mended, links_of, meshes_of, subject_of, with_remedy
from gemelo.libraries.robot_import.questions import Questions, yes_or_no
from gemelo.schemas.reasons import Reason, Value, because, remedy

AS_COLLISION = remedy("left_out_drawn_with_collision")


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
            if item.tag == "visual" and _touches_wholly(mended, link):
                link.remove(item)
                mended.warn(mesh, subject_of(link), because("mesh.none", AS_COLLISION, mesh=reference))
                continue
            mend = remedy("put_below", folder=str(mended.source.root))
            mended.fail(mesh, subject_of(link), with_remedy(mended.source.missing(reference), mend))
        elif found is not None:
            mended.files[reference] = found
            if reference.startswith("package://"):
                package = reference.split("/")[2]
                by_package[package] = by_package.get(package, 0) + 1
    for package, count in by_package.items():
        named = because("mend.mesh.package", remedy("relative_and_copied"), count=count, package=package)
        mended.notes.append(note(mended.source.label, Subject("meshes"), named))


def _found(mended: Mended, link: ET.Element, mesh: ET.Element, reference: str) -> Path | None:
    """The file; one of the same name in another format where that is the only one."""
    found = mended.source.find(reference) if reference else None
    if found is not None or not reference:
        return found
    other = mended.source.in_another_format(reference)
    if other is not None and reference not in mended.files:
        mend = remedy("written", text=f'filename="{other.name}"')
        mended.say(mesh, subject_of(link), because("mend.mesh.format", mend, mesh=reference, other=other.name))
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
            mended.warn(mesh, subject_of(link), because("mesh.wrong", known, AS_COLLISION, mesh=geometry.mesh or ""))


def flat(mended: Mended) -> None:
    """A mesh without volume is drawn nowhere and fitted to nothing."""
    for link, _, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and known.is_flat:
            link.remove(item)
            no_volume = because("mend.mesh.flat", LEFT_OUT, mesh=geometry.mesh or "", tag=item.tag)
            mended.say(mesh, subject_of(link), no_volume)


def tiny(mended: Mended) -> None:
    """A mesh of less than two millimetres is a placeholder; or, where it is scaled, scaled too much."""
    for link, _, item, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        scale = max(map(abs, geometry.scale))
        if not isinstance(known, MeshFacts) or not 0.0 < known.longest * scale < SMALLEST:
            continue
        size: dict[str, Value] = {"mesh": geometry.mesh or "", "length": known.longest * scale}
        if scale == 1.0:
            link.remove(item)
            mended.say(mesh, subject_of(link), because("mend.mesh.placeholder", LEFT_OUT, **size))
        else:
            mend = remedy("correct_scale", scale=mesh.get("scale", ""))
            mended.fail(mesh, subject_of(link), because("mend.mesh.tiny", mend, **size))


def frames(mended: Mended) -> None:
    """Leaves out the inertia of a link without mass."""
    for link, model in links_of(mended):
        inertial = link.find("inertial")
        if inertial is not None and model.inertial is not None and model.inertial.mass == 0.0:
            link.remove(inertial)
            mended.say(inertial, subject_of(link), because("mend.link.frame", remedy("inertial_left_out")))


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
        link.remove(inertial)
        even = _even_density(model, known.mass, mended.facts)
        if even is not None:
            link.insert(0, even)
            mended.xml.lines[even] = mended.xml.lines.get(inertial, 0)
        mend = LEFT_OUT if even is None else remedy("inertia_of_mesh", mass=known.mass)
        code = "mend.inertia.unit" if far else "mend.inertia"
        mended.say(inertial, subject_of(link), because(code, mend, low=low, middle=middle, high=high))


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
            mended.say(collisions[0], subject_of(link), because("mend.link.unseen", remedy("drawn_with_the_same")))


def shapeless(mended: Mended) -> list[Finding]:
    """A robot without any shape, or a length to draw: an error for who would import it."""
    if any(link.find("visual") is not None for link in mended.xml.root.findall("link")):
        return []
    return [error(mended.source.label, Subject("robot"), because("mend.robot.nothing", remedy("give_shapes")))]


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
    names = tuple(link.name for _, link in bare)
    has_some = any(link.collisions for link in mended.model.links)
    question = because("import.ask.shapes", links=names)
    mended.fits_bare = not has_some or questions.ask("shapes_for_drawn", question, "no", yes_or_no)
    for element, _ in bare if not mended.fits_bare else ():
        mended.warn(element, subject_of(element), with_remedy(UNTOUCHED, remedy("shapes_for_drawn")))
    if mended.fits_bare:
        element, _ = bare[0]
        what = because("mend.links.drawn", remedy("shapes_fit_drawn"), count=len(bare), links=names)
        mended.say(element, subject_of(element), what)


def own_collisions(mended: Mended) -> None:
    """Collision meshes of a person's own, to which shapes are fitted."""
    own = [(element, link) for element, link in links_of(mended) if any(each.mesh for each in link.collisions)]
    other = [each for each in own if {s.mesh for s in each[1].collisions} != {s.mesh for s in each[1].visuals}]
    if other:
        element, _ = other[0]
        what = because("mend.links.own", remedy("shapes_fit_own"), count=len(other))
        mended.say(element, subject_of(element), what)
