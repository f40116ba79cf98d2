"""Rods for a robot that has no shape at all: one from each joint to the next, to look at and to plan with."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from gemelo.libraries.arm.checks.units import joint_lengths
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import UrdfJoint
from gemelo.libraries.robot_import.mended import Mended
from gemelo.schemas.reasons import because, remedy

# Tuning constants: chosen, where a line does not say measured or standard.
RADIUS_SHARE = 0.025  # of the longest rod: thin, and yet seen
SHORTEST = 2.0  # radii: a shorter rod would lie in the balls at its ends


def sticks(mended: Mended) -> None:
    """Draws every link as rods to the joints that it carries, and the last ones as balls, where none has a shape."""
    root, model = mended.xml.root, mended.model
    radius = RADIUS_SHARE * max((each.size for each in joint_lengths(model)), default=0.0)
    if not radius or any(
        link.find(tag) is not None for link in root.findall("link") for tag in ("visual", "collision")
    ):
        return
    for link in root.findall("link"):
        carried = [joint for joint in model.joints if joint.parent == link.get("name")]
        rods = [_rod(joint, radius) for joint in carried if math.hypot(*joint.origin.xyz) > SHORTEST * radius]
        for shape in rods or ([] if carried else [_visual("sphere", {"radius": f"{radius:.6g}"})]):
            link.append(shape)
            mended.xml.lines[shape] = mended.xml.lines.get(link, 0)
    rods_instead = remedy("rods_instead", thickness=2.0 * radius)
    mended.warn(root, Subject("robot"), because("mend.robot.no_shape", rods_instead))


def _rod(joint: UrdfJoint, radius: float) -> ET.Element:
    """From the link's own frame to the joint's origin; `radius` [m]."""
    x, y, z = joint.origin.xyz
    middle = " ".join(f"{0.5 * value:.9g}" for value in (x, y, z))
    turn = f"0 {math.atan2(math.hypot(x, y), z):.9g} {math.atan2(y, x):.9g}"
    sizes = {"radius": f"{radius:.6g}", "length": f"{math.hypot(x, y, z):.9g}"}
    return _visual("cylinder", sizes, {"xyz": middle, "rpy": turn})


def _visual(tag: str, sizes: dict[str, str], origin: dict[str, str] | None = None) -> ET.Element:
    visual = ET.Element("visual")
    if origin:
        ET.SubElement(visual, "origin", origin)
    ET.SubElement(ET.SubElement(visual, "geometry"), tag, sizes)
    return visual
