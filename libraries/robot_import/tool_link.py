"""The link that an imported arm's goals are about by default: by its name, else the end of the longest chain of joints.

The jaws of a gripper are no tool: a goal for one of them would be about the opening too.
"""

from __future__ import annotations

from collections.abc import Iterator

from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, UrdfModel

# The ends of a tool's name, the most telling first.
TOOL_NAMES = (
    "tool0", "tcp", "tool", "ee_link", "end_effector", "eef", "tcp_link", "tool_link", "tool_frame",
    "end_effector_link", "ee_frame", "_ee", "gripper_frame_link", "gripper_frame", "gripperframe", "grasp_frame",
    "grasp_link", "flange", "hand", "gripper_link", "gripper",
)  # fmt: skip
JAW_WORDS = ("finger", "jaw", "knuckle", "claw", "thumb", "dedo", "mordaza")  # in the names of joint or link


def tool_link(model: UrdfModel) -> str:
    """The name of a link of `model`, which has one root."""
    depths = _depths(model)
    candidates = _carried(model) or list(depths)
    for wanted in TOOL_NAMES:
        found = [link for link in candidates if _is_called(link, wanted)]
        if found:
            return max(found, key=lambda link: depths[link])
    return max(candidates, key=lambda link: depths[link])


def other_tools(model: UrdfModel, tool: str) -> list[str]:
    """The links with a tool's name that neither carry the link `tool` nor are carried by it."""
    named = [link for link in _carried(model) if any(_is_called(link, wanted) for wanted in TOOL_NAMES)]
    return [link for link in named if link not in _behind(tool, model) and tool not in _behind(link, model)]


def _carried(model: UrdfModel) -> list[str]:
    """The links that a joint moves, without the jaws."""
    jaws = {link for joint in _jaw_joints(model) for link in _behind(joint.child, model)}
    moved = {link for joint in model.joints if _moves(joint) for link in _behind(joint.child, model)}
    return [link for link in _depths(model) if link not in jaws and link in moved]


def _is_called(link: str, wanted: str) -> bool:
    return link.lower().rpartition("-")[2].endswith(wanted)


def _depths(model: UrdfModel) -> dict[str, int]:
    """The number of joints between each link and the root, in the links' order."""
    depths = {link.name: 0 for link in model.links}
    for _ in model.joints:
        for joint in model.joints:
            if joint.parent in depths and joint.child in depths:
                depths[joint.child] = depths[joint.parent] + 1
    return depths


def _jaw_joints(model: UrdfModel) -> Iterator[UrdfJoint]:
    """Those with a jaw's name; of those behind which nothing is driven, those of a jaw's link, two or more that move on
    one link, and two of which one follows the other beside it, as in no chain of an arm.
    """
    last = [joint for joint in model.joints if _moves(joint) and not _drives_behind(joint, model)]
    beside = [joint.parent for joint in last]
    for joint in model.joints:
        names = f"{joint.name} {joint.child if joint in last else ''}".lower()  # a wrist carries the fixed jaw
        if _moves(joint) and any(word in names for word in JAW_WORDS):
            yield joint
    for joint in last:
        if beside.count(joint.parent) > 1:
            yield joint
        if joint.mimic is not None and joint.mimic.joint in model.joint_names:
            leader = model.joint(joint.mimic.joint)
            if leader in last and joint.child not in _behind(leader.child, model):
                yield from (leader, joint)


def _drives_behind(joint: UrdfJoint, model: UrdfModel) -> bool:
    """True if a joint that follows no other is carried by this one."""
    carried = _behind(joint.child, model)
    return any(each.parent in carried and _moves(each) and each.mimic is None for each in model.joints)


def _behind(link: str, model: UrdfModel) -> set[str]:
    """The link and all that it carries."""
    found, front = {link}, [link]
    while front:
        parent = front.pop()
        onward = {joint.child for joint in model.joints if joint.parent == parent} - found
        found |= onward
        front += onward
    return found


def _moves(joint: UrdfJoint) -> bool:
    return joint.kind is not JointKind.FIXED
