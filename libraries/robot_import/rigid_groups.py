"""Many links that no joint moves against one another, as an assembly's screws: drawn and checked as one part."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose
from gemelo.libraries.arm.kinematics.chain import origin_of
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.libraries.robot_import.link_boxes import pose_of
from gemelo.libraries.robot_import.mended import Mended, links_of, subject_of
from gemelo.libraries.robot_import.mesh_places import set_origin

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_PARTS = 40  # links with shapes: of more, pairs are sampled for minutes, and the native planner takes 64


def merge_rigid(mended: Mended) -> None:
    """Gives the shapes of links that are fixed to another to that one, where there are more than `MOST_PARTS`."""
    links = links_of(mended)
    if sum(bool(link.visuals or link.collisions) for _, link in links) <= MOST_PARTS:
        return
    above = {joint.child: joint for joint in mended.model.joints if joint.kind is JointKind.FIXED}
    elements = {link.name: element for element, link in links}
    moved: dict[str, int] = {}
    for element, link in links:
        root, pose = link.name, IDENTITY
        while root in above:
            pose = compose(origin_of(above[root]), pose)
            root = above[root].parent
        if root == link.name or not (link.visuals or link.collisions):
            continue
        moved[root] = moved.get(root, 0) + 1
        shapes = (*link.visuals, *link.collisions)
        for item, shape in zip((*element.findall("visual"), *element.findall("collision")), shapes, strict=True):
            element.remove(item)
            _give(elements[root], item, compose(pose, pose_of(shape)))
            mended.xml.lines.setdefault(item, mended.xml.lines.get(element, 0))
    for root, count in moved.items():
        message = f"{count} links with shapes are fixed to it, of {len(links)} links in all"
        mended.say(
            elements[root], subject_of(elements[root]), message, "they are drawn and checked as one part with it"
        )


def _give(link: ET.Element, item: ET.Element, pose: Rigid) -> None:
    set_origin(item, pose)
    link.append(item)
