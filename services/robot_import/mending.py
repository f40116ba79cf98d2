"""What is wrong with a source, all at once; what has one answer is mended in the elements, and said."""

from __future__ import annotations

import math
import re
import unicodedata
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from services.arm.checks.findings import Finding, Severity, error, note, warning
from services.arm.checks.meshes import (
    SMALLEST,
    Facts,
    MeshFacts,
    check_meshes,
    facts_of,
    is_in_millimetres,
    link_volume,
)
from services.arm.checks.urdf import check_urdf, fault_finding, principal_moments
from services.arm.errors import DescriptionError
from services.arm.model.urdf import Geometry, JointKind, UrdfLink, UrdfModel, model_of
from services.arm.model.xml_reader import XmlReader, parse_xml
from services.robot_import.joint_mending import fix_free_base, follow_the_motor
from services.robot_import.source import Source

FOREIGN = ("gazebo", "transmission", "ros2_control", "sensor")
MOVES = (JointKind.REVOLUTE, JointKind.CONTINUOUS, JointKind.PRISMATIC)


@dataclass
class Mended:
    """The elements of a source as they are to be written, and what was said of them."""

    source: Source
    xml: XmlReader
    files: dict[str, Path]  # mesh references as written, and the files that they mean
    notes: list[Finding] = field(default_factory=list)
    errors: list[Finding] = field(default_factory=list)

    @property
    def model(self) -> UrdfModel:
        """As it is now, with what cannot be read left at a default."""
        return model_of(XmlReader(self.xml.root, self.xml.lines))[0]

    def findings(self) -> list[Finding]:
        """Everything: errors, warnings, and what is mended."""
        model, faults = model_of(XmlReader(self.xml.root, self.xml.lines))
        file = self.source.label
        found = [*self.errors, *(fault_finding(fault, file) for fault in faults)]
        found += [*check_urdf(model, Path(file), has_meshes=False), *check_meshes(model, file, self.facts)]
        return sorted([*found, *self.notes], key=lambda each: list(Severity).index(each.severity))

    def facts(self, geometry: Geometry) -> MeshFacts | str | None:
        """Of its mesh; None where it is none or its file is not there."""
        file = self.files.get(geometry.mesh or "")
        return None if file is None else _facts(file)

    def say(self, element: ET.Element, subject: str, message: str, remedy: str) -> None:
        """Notes what is mended."""
        self.notes.append(note(self.source.label, subject, message, remedy, self.xml.lines.get(element, 0)))

    def warn(self, element: ET.Element, subject: str, message: str, remedy: str) -> None:
        """Warns of what a default stands for that nobody has given."""
        self.notes.append(warning(self.source.label, subject, message, remedy, self.xml.lines.get(element, 0)))


@lru_cache(maxsize=256)
def _facts(file: Path) -> MeshFacts | str:
    return facts_of(file)


def mend(source: Source) -> Mended:
    """The source, mended; raises `DescriptionError` where it is no URDF at all."""
    try:
        xml = parse_xml(source.text)
        model_of(xml)
    except DescriptionError as said:
        raise DescriptionError(f"{source.urdf}: {said}") from said
    _require_links(xml, source)
    xml.faults.clear()
    mended = Mended(source, xml, {})
    for step in (
        _foreign,
        _prefixed,
        _names,
        _references,
        _free_base,
        _endless,
        _axes,
        _mimics,
        _millimetres,
        _flat,
        _tiny,
        _frames,
        _inertias,
        _unseen,
    ):
        step(mended)
    return mended


def _require_links(xml: XmlReader, source: Source) -> None:
    """Raises `DescriptionError` for a robot without any link, as of a xacro file of macros that others call."""
    if xml.root.find("link") is None:
        remedy = "name the file that calls its macros" if source.is_expanded else "export it again"
        raise DescriptionError(f"{source.urdf}: it has no <link>: {remedy}")


def safe_name(text: str, known: set[str], allowed: str = r"[^A-Za-z0-9_.-]+") -> str:
    """ "Brazo nº 1" as Brazo_n_1: ASCII, and no other of `known`, to which it is added."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    stem = re.sub(allowed, "_", plain).strip("_") or "part"
    name, number = stem, 2
    while name in known:
        name, number = f"{stem}_{number}", number + 1
    known.add(name)
    return name


def _foreign(mended: Mended) -> None:
    """What is neither kinematics nor shape: elements of simulators and drivers, and pictures on surfaces."""
    root = mended.xml.root
    for tag in FOREIGN:
        elements = root.findall(tag)
        for element in elements:
            root.remove(element)
        if elements:
            mended.say(elements[0], f"<{tag}>", f"{len(elements)} of these say nothing that is used here", "left out")
    for material in root.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
            mended.say(texture, "<texture>", f'"{texture.get("filename")}" is not drawn', "left out")
    _colours(mended)


def _prefixed(mended: Mended) -> None:
    """Elements and attributes of another program's namespace, over which readers stumble where it is not declared."""
    found: dict[str, list[ET.Element]] = {}
    for parent in list(mended.xml.root.iter()):
        for element in [each for each in parent if ":" in each.tag]:
            parent.remove(element)
            found.setdefault(element.tag, []).append(element)
        for name in [each for each in parent.attrib if ":" in each]:
            del parent.attrib[name]
            found.setdefault(name, []).append(parent)
    for name, elements in found.items():
        if not name.startswith("xmlns:"):
            mended.say(elements[0], f'"{name}"', f"{len(elements)} of these say nothing that is used here", "left out")


def _colours(mended: Mended) -> None:
    """A material that nothing gives a colour: every reader of URDFs complains of it, and nothing is drawn with it."""
    root = mended.xml.root
    for material in list(root.iter("material")):
        for color in material.findall("color"):
            if len(_numbers(color.get("rgba", "")) or ()) != 4:
                material.remove(color)
    known = {material.get("name") for material in root.iter("material") if material.find("color") is not None}
    said: set[str | None] = set()
    for parent in [root, *root.iter("visual")]:
        for material in parent.findall("material"):
            name = material.get("name")
            if material.find("color") is not None or (name in known and parent is not root):
                continue
            parent.remove(material)
            if name not in said:
                mended.say(material, f'material "{name}"', "nothing gives it a colour", "left out")
            said.add(name)


def _names(mended: Mended) -> None:
    """Blanks and accents in names of links and joints."""
    for tag, roles in (("link", ("parent", "child")), ("joint", ())):
        elements = [element for element in mended.xml.root.findall(tag) if element.get("name")]
        known = {element.get("name", "") for element in elements}
        for element in elements:
            old = element.get("name", "")
            if re.fullmatch(r"[A-Za-z0-9_.-]+", old):
                continue
            new = safe_name(old, known)
            element.set("name", new)
            mended.say(element, f'{tag} "{old}"', "its name has blanks or letters that commands do not take", f"{new}")
            for joint in mended.xml.root.findall("joint"):
                for role in (joint.find(word) for word in roles or ("mimic",)):
                    if role is not None and role.get(tag) == old:
                        role.set(tag, new)


def _references(mended: Mended) -> None:
    """The files that meshes mean; a missing one is an error."""
    by_package: dict[str, int] = {}
    missing: set[tuple[ET.Element, str]] = set()  # most are in <visual> and in <collision>
    for link, _, _, mesh in _meshes(mended):
        reference = mesh.get("filename", "")
        found = mended.source.find(reference) if reference else None
        if found is None and reference and (link, reference) not in missing:
            missing.add((link, reference))
            message = f'mesh "{reference}" is not there{mended.source.near(reference)}'
            line = mended.xml.lines.get(mesh, 0)
            file = mended.source.label
            mended.errors.append(error(file, _subject(link), message, f"put it below {mended.source.root}", line))
        elif found is not None:
            mended.files[reference] = found
            if reference.startswith("package://"):
                package = reference.split("/")[2]
                by_package[package] = by_package.get(package, 0) + 1
    for package, count in by_package.items():
        message = f"{count} meshes are named by the ROS package path package://{package}"
        mended.notes.append(note(mended.source.label, "meshes", message, "relative paths, the files copied"))


def _free_base(mended: Mended) -> None:
    fix_free_base(mended.xml, mended.warn)


def _endless(mended: Mended) -> None:
    """Limits that are infinite, or no number at all, are none: what a joint lacks is asked for."""
    for joint in mended.xml.root.findall("joint"):
        for limit in joint.findall("limit"):
            named = [key for key, text in limit.items() if any(not math.isfinite(x) for x in _numbers(text) or ())]
            if named:
                where, message = f'joint "{joint.get("name")}"', f"its {', '.join(named)} in <limit> is not finite"
                mended.say(limit, where, message, "left out")
            for key in named:
                del limit.attrib[key]


def _axes(mended: Mended) -> None:
    harmless: list[tuple[ET.Element, str]] = []
    for joint in mended.xml.root.findall("joint"):
        axis = joint.find("axis")
        numbers = None if axis is None else _numbers(axis.get("xyz", "1 0 0"))
        if axis is None or numbers is None:
            continue
        length = math.sqrt(sum(value * value for value in numbers))
        where = f'joint "{joint.get("name")}"'
        if joint.get("type") not in MOVES:
            if length < 1e-9:
                harmless.append((axis, where))
            joint.remove(axis)
        elif length >= 1e-9 and abs(length - 1.0) > 1e-6:
            text = " ".join(f"{value / length:.9g}" for value in numbers)
            mended.say(axis, where, f'its axis "{axis.get("xyz")}" is {length:.4g} long, not 1', f'xyz="{text}"')
            axis.set("xyz", text)
    for axis, where in harmless[:1]:  # some exporters write it for every frame
        more = f", and of {len(harmless) - 1} more" if harmless[1:] else ""
        mended.say(axis, where, f"a fixed joint's axis is zero, which is harmless{more}", "left out")


def _mimics(mended: Mended) -> None:
    follow_the_motor(mended.xml, mended.say)
    for joint in mended.xml.root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("type") in MOVES:
            message = f'follows joint "{mimic.get("joint")}"'
            mended.say(mimic, f'joint "{joint.get("name")}"', message, "it gets no motor of its own")


def _millimetres(mended: Mended) -> None:
    said: set[str | None] = set()  # most are in <visual> and in <collision>
    for link, _, geometry, mesh in _meshes(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and is_in_millimetres(geometry, known):
            scale = " ".join(f"{0.001 * value:.9g}" for value in geometry.scale)
            length = known.longest * max(map(abs, geometry.scale))
            message = f'mesh "{geometry.mesh}" is {length:.4g} m long: it is in millimetres'
            mesh.set("scale", scale)
            if geometry.mesh not in said:
                mended.say(mesh, _subject(link), message, f'scale="{scale}"')
            said.add(geometry.mesh)


def _flat(mended: Mended) -> None:
    """A mesh without volume is drawn nowhere and fitted to nothing."""
    for link, item, geometry, mesh in _meshes(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and known.is_flat:
            message = f'mesh "{geometry.mesh}" in <{item.tag}> bounds no volume'
            link.remove(item)
            mended.say(mesh, _subject(link), message, "left out")


def _tiny(mended: Mended) -> None:
    """A mesh of less than two millimetres is a placeholder; or, where it is scaled, scaled too much."""
    for link, item, geometry, mesh in _meshes(mended):
        known = mended.facts(geometry)
        scale = max(map(abs, geometry.scale))
        if not isinstance(known, MeshFacts) or not 0.0 < known.longest * scale < SMALLEST:
            continue
        message = f'mesh "{geometry.mesh}" is {1000.0 * known.longest * scale:.3g} mm long'
        if scale == 1.0:
            link.remove(item)
            mended.say(mesh, _subject(link), f"{message}: it stands for nothing", "left out")
        else:
            line = mended.xml.lines.get(mesh, 0)
            remedy = f'correct scale="{mesh.get("scale")}"'
            mended.errors.append(error(mended.source.label, _subject(link), message, remedy, line))


def _frames(mended: Mended) -> None:
    for link, model in _links(mended):
        inertial = link.find("inertial")
        if inertial is not None and model.inertial is not None and model.inertial.mass == 0.0:
            link.remove(inertial)
            mended.say(inertial, _subject(link), "its mass is 0 kg: it is a mere frame", "<inertial> left out")


def _inertias(mended: Mended) -> None:
    """One that no body has becomes that of the meshes, of even density and of the same mass."""
    for link, model in _links(mended):
        inertial, known = link.find("inertial"), model.inertial
        if inertial is None or known is None or not known.mass > 0.0:
            continue
        low, middle, high = principal_moments(known)
        if low > 0.0 and low + middle >= high * (1.0 - 1e-6):
            continue
        message = f"its principal moments {low:.3g}, {middle:.3g}, {high:.3g} kg m^2 are of no body"
        link.remove(inertial)
        even = _even_density(model, known.mass, mended.facts)
        if even is not None:
            link.insert(0, even)
            mended.xml.lines[even] = mended.xml.lines.get(inertial, 0)
        remedy = "left out" if even is None else f"that of its mesh at {known.mass:g} kg of even density"
        mended.say(inertial, _subject(link), message, remedy)


def _unseen(mended: Mended) -> None:
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
            mended.say(collisions[0], _subject(link), "has a <collision>, but no <visual>", "drawn with the same shape")


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


def _meshes(mended: Mended) -> Iterator[tuple[ET.Element, ET.Element, Geometry, ET.Element]]:
    """Link, visual or collision, how it was read, and its <mesh>."""
    for link, model in _links(mended):
        shapes = zip(
            (*link.findall("visual"), *link.findall("collision")), (*model.visuals, *model.collisions), strict=True
        )
        for item, geometry in list(shapes):
            mesh = item.find("geometry/mesh")
            if mesh is not None:
                yield link, item, geometry, mesh


def _links(mended: Mended) -> list[tuple[ET.Element, UrdfLink]]:
    return list(zip(mended.xml.root.findall("link"), mended.model.links, strict=True))


def _subject(link: ET.Element) -> str:
    return f'link "{link.get("name")}"'


def _numbers(text: str) -> list[float] | None:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return None
