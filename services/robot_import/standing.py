"""Joints of a robot that are not of the arm that carries the tool: wheels, a second arm. They may stand still."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from services.arm.device.device_config import MAX_COUNTS
from services.arm.errors import DescriptionError
from services.arm.model.urdf import JointKind, UrdfJoint, UrdfModel
from services.arm.model.virtual_drive import driven_joints
from services.robot_import.joint_mending import fix
from services.robot_import.mending import Mended
from services.robot_import.questions import Questions, yes_or_no

MOST = MAX_COUNTS["joint"]  # that one device drives
FEW = 3  # names that are said
WHEEL = "wheel"  # in the name of a joint or its link


def ask_who_stands(mended: Mended, tool: str, questions: Questions) -> None:
    """Makes the joints that do not carry `tool` fixed at 0 where a person wants them to stand still; raises
    `DescriptionError` where more are left than a device drives.
    """
    model = mended.model
    driven = driven_joints(model)
    aside = _aside(model, driven, tool)
    if aside:
        names = ", ".join(joint.name for joint in aside)
        question = f'do these joints, which do not carry "{tool}", stand still at 0: {names}?'
        stand = len(driven) > MOST or any(_is_wheel(joint) for joint in aside)
        if questions.ask("others_stand_still", question, "yes" if stand else "no", yes_or_no):
            _stand(mended, aside, tool)
            driven = [joint for joint in driven if joint not in aside]
    if len(driven) > MOST:
        others = 'say "yes" to others_stand_still' if len(driven) - len(aside) <= MOST else "make some of them fixed"
        raise DescriptionError(f"it has {len(driven)} joints to drive, and a device drives {MOST}: {others}")


def _aside(model: UrdfModel, driven: list[UrdfJoint], tool: str) -> list[UrdfJoint]:
    """The driven joints that neither move the tool nor are carried by the last joint that does, as a gripper's are."""
    parents = {joint.child: joint for joint in model.joints}
    path: list[UrdfJoint] = []
    link = tool
    while link in parents and parents[link] not in path:
        path.append(parents[link])
        link = parents[link].parent
    last = next((joint for joint in path if joint in driven), None)
    if last is None:
        return []
    carried = {joint.name for joint in driven if _is_behind(joint.parent, last.child, parents)}
    return [joint for joint in driven if joint not in path and joint.name not in carried]


def _is_behind(link: str, first: str, parents: dict[str, UrdfJoint]) -> bool:
    """True if `first` carries `link`, or is it."""
    seen: set[str] = set()
    while link != first and link in parents and link not in seen:
        seen.add(link)
        link = parents[link].parent
    return link == first


def _is_wheel(joint: UrdfJoint) -> bool:
    return joint.kind is JointKind.CONTINUOUS and WHEEL in f"{joint.name} {joint.child}".lower()


def _stand(mended: Mended, aside: list[UrdfJoint], tool: str) -> None:
    """Fixes the joints and those that follow them, and says it once."""
    names = [joint.name for joint in aside]
    elements = {joint.get("name", ""): joint for joint in mended.xml.root.findall("joint")}
    followers = [joint.name for joint in mended.model.joints if joint.mimic is not None and joint.mimic.joint in names]
    for name in (*names, *followers):
        fix(elements[name])
    few = ", ".join(names[:FEW]) + (f" and {len(names) - FEW} more" if len(names) > FEW else "")
    _say(mended, elements[names[0]], f'{len(names)} joints do not carry the tool "{tool}" ({few})')


def _say(mended: Mended, element: ET.Element, message: str) -> None:
    remedy = "they stand still at 0; `tool_frame` and `others_stand_still` in the file of answers choose otherwise"
    mended.warn(element, f'joint "{element.get("name")}"', message, remedy)
