"""Joints of a robot that are not of the arm that carries the tool: wheels, a second arm. They may stand still."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from gemelo.libraries.arm.device.device_config import MAX_COUNTS
from gemelo.libraries.arm.errors import Subject, nearest
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, UrdfModel
from gemelo.libraries.arm.model.virtual_drive import driven_joints
from gemelo.libraries.robot_import.joint_mending import stand_at
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.poses import zero_state
from gemelo.libraries.robot_import.questions import BadAnswer, Questions, yes_or_no
from gemelo.schemas.reasons import Remedy, Value, because, remedy

MOST = MAX_COUNTS["joint"]  # that one device drives
STANDING, DRIVEN = remedy("others_stand_still"), remedy("others_are_driven")
STAY = remedy("others_stay")
WHEEL = "wheel"  # in the name of a joint or its link


def ask_who_stands(mended: Mended, tool: str, questions: Questions) -> None:
    """Makes the joints that do not carry `tool` fixed near 0 where a person wants them to stand still, and those that
    are more than a device drives."""
    model = mended.model
    driven = driven_joints(model)
    aside = _aside(model, driven, tool)
    if aside:
        question = because("import.ask.stand", tool=tool, joints=tuple(joint.name for joint in aside))
        stand = len(driven) > MOST or any(_is_wheel(joint) for joint in aside)
        if questions.ask("others_stand_still", question, "yes" if stand else "no", yes_or_no):
            stand_at(mended, zero_state(aside))
            _say(mended, aside, tool, STANDING)
            driven = [joint for joint in driven if joint not in aside]
        else:
            _say(mended, aside, tool, DRIVEN)
    if len(driven) > MOST:
        _ask_which_are_driven(mended, driven, tool, questions)


def _ask_which_are_driven(mended: Mended, driven: list[UrdfJoint], tool: str, questions: Questions) -> None:
    """Of more joints than a device drives: by default those that carry the tool, and what the last of them carries."""
    chain = {joint.name for joint in _chain(mended.model, driven, tool)}
    usual = [joint.name for joint in driven if joint.name in chain]
    question = because("import.ask.driven", count=len(driven), most=MOST)
    names = questions.ask("driven_joints", question, " ".join(usual), lambda text: _names(text, driven))
    held = [joint for joint in driven if joint.name not in names]
    stand_at(mended, zero_state(held))
    counts: dict[str, Value] = {"count": len(driven), "most": MOST}
    what = because("mend.driven.one", STAY, joint=held[0].name, **counts)
    if held[1:]:
        what = because("mend.driven.several", STAY, joints=tuple(joint.name for joint in held), **counts)
    mended.warn(_element(mended, held[0]), Subject("joint", held[0].name), what)


def _element(mended: Mended, joint: UrdfJoint) -> ET.Element:
    return next(each for each in mended.xml.root.findall("joint") if each.get("name") == joint.name)


def _chain(model: UrdfModel, driven: list[UrdfJoint], tool: str) -> list[UrdfJoint]:
    """The joints nearest to the tool of those that carry it, then others of the tool, as many as a device drives."""
    above = {joint.child: joint for joint in model.joints}
    path = _path_to_base(tool, above)
    carrying = [joint for joint in path if joint in driven][:MOST]
    if not carrying:
        return driven[:MOST]
    carried = [each for each in driven if each not in path and _is_behind(each.parent, carrying[0].child, above)]
    return [*carrying, *carried][:MOST]


def _names(text: str, driven: list[UrdfJoint]) -> list[str]:
    """Raises ValueError."""
    names, known = text.replace(",", " ").split(), [joint.name for joint in driven]
    strange = [name for name in names if name not in known]
    if strange:
        raise BadAnswer(because("import.answer.no_joint", nearest(strange[0], known), name=strange[0]))
    if not 0 < len(set(names)) <= MOST:
        raise BadAnswer(because("import.answer.joints", most=MOST))
    return names


def _aside(model: UrdfModel, driven: list[UrdfJoint], tool: str) -> list[UrdfJoint]:
    """The driven joints that neither move the tool nor are carried by the last joint that does, as a gripper's are."""
    above = {joint.child: joint for joint in model.joints}
    path = _path_to_base(tool, above)
    last = next((joint for joint in path if joint in driven), None)
    if last is None:
        return []
    carried = {joint.name for joint in driven if _is_behind(joint.parent, last.child, above)}
    return [joint for joint in driven if joint not in path and joint.name not in carried]


def _path_to_base(link: str, above: dict[str, UrdfJoint]) -> list[UrdfJoint]:
    """The joints that carry `link`, nearest first, each once; `above` has the joint above each link."""
    path: list[UrdfJoint] = []
    while link in above and above[link] not in path:
        path.append(above[link])
        link = above[link].parent
    return path


def _is_behind(link: str, first: str, above: dict[str, UrdfJoint]) -> bool:
    """True if `first` carries `link`, or is it."""
    return link == first or any(joint.parent == first for joint in _path_to_base(link, above))


def _is_wheel(joint: UrdfJoint) -> bool:
    return joint.kind is JointKind.CONTINUOUS and WHEEL in f"{joint.name} {joint.child}".lower()


def _say(mended: Mended, aside: list[UrdfJoint], tool: str, mend: Remedy) -> None:
    names = tuple(joint.name for joint in aside)
    what = because("mend.joints.aside", mend, count=len(names), tool=tool, joints=names)
    mended.warn(_element(mended, aside[0]), Subject("joint", names[0]), what)
