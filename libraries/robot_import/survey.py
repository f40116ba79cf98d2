"""The findings of a source before anything is built: one list for `gemelo check` and `gemelo import`."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gemelo.libraries.arm.checks.findings import Finding, Severity, error
from gemelo.libraries.arm.checks.meshes import MOST_TRIANGLES, MeshFacts
from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose
from gemelo.libraries.arm.kinematics.chain import origin_of
from gemelo.libraries.arm.model.urdf import JointKind, UrdfModel
from gemelo.libraries.arm.model.virtual_drive import MAX_NAME, device_name, driven_joints
from gemelo.libraries.robot_import import motion_limits
from gemelo.libraries.robot_import.drive import ask_drives
from gemelo.libraries.robot_import.limits import ask_limits
from gemelo.libraries.robot_import.link_boxes import pose_of
from gemelo.libraries.robot_import.link_mending import shapeless, untouched
from gemelo.libraries.robot_import.mended import Mended, links_of, meshes_of, subject_of
from gemelo.libraries.robot_import.mending import mend, safe_name
from gemelo.libraries.robot_import.mesh_places import set_origin
from gemelo.libraries.robot_import.parts import MOTORS, USUAL_DRIVER, DriverPart, MotorPart, driver_named, motor_named
from gemelo.libraries.robot_import.questions import Questions, yes_or_no
from gemelo.libraries.robot_import.robot_folder import Description
from gemelo.libraries.robot_import.semantics import semantics
from gemelo.libraries.robot_import.source import RobotSource
from gemelo.libraries.robot_import.standing import ask_who_stands
from gemelo.libraries.robot_import.tool_link import other_tools, tool_link

LONGEST_NAME = 60  # letters: with what others add it is a folder's name everywhere
NOT_IN_A_NAME = r"[^A-Za-z0-9_-]+"
# Tuning constants: chosen, where a line does not say measured or standard.
MOST_PARTS = 40  # links with shapes: of more, pairs are sampled for minutes, and the native planner takes 64


@dataclass(frozen=True)
class Survey:
    """All findings of a source, errors first; `description` is what is built of it, None where there are errors."""

    findings: list[Finding]
    description: Description | None

    @property
    def errors(self) -> list[Finding]:
        """Those without one answer."""
        return [each for each in self.findings if each.severity is Severity.ERROR]


def surveyed(source: RobotSource, questions: Questions, name: str = "", motor: str = "", driver: str = "") -> Survey:
    """The source as `questions` are answered, with the name, motor and driver that are given; raises
    `DescriptionError` for a wrong answer, and for a source that is no URDF at all."""
    mended = mend(source, questions)
    ask_limits(mended, questions)
    motion_limits.followers(mended)
    semantics(mended)
    _dense(mended)
    findings = [*shapeless(mended), *mended.findings()]
    if any(each.severity is Severity.ERROR for each in findings):
        return Survey(findings, None)
    untouched(mended, questions)
    try:
        description = _described(mended, questions, name, motor, driver)
    except _NoArm as why:
        findings = [error(source.label, "robot", str(why), why.remedy, mended.xml.lines.get(mended.xml.root, 0))]
        return Survey([*findings, *mended.findings()], None)
    return Survey(mended.findings(), description)


class _NoArm(ValueError):
    """Why nothing can be built of a source, and what would do."""

    def __init__(self, why: str, remedy: str) -> None:
        super().__init__(why)
        self.remedy = remedy


def _described(mended: Mended, questions: Questions, name: str, motor: str, driver: str) -> Description:
    """With what a URDF cannot say, asked."""
    wanted = name or mended.xml.root.get("name") or mended.source.urdf.stem
    robot = safe_name(wanted[:LONGEST_NAME], set(), NOT_IN_A_NAME)
    _say_name(mended, robot)
    usual_motor = _part(motor_named, motor or MOTORS[0].name)
    usual_driver = _part(driver_named, driver or USUAL_DRIVER)
    tool = questions.ask("tool_frame", "the tool's link", _tool(mended), _link_of(mended.model))
    others = other_tools(mended.model, tool)
    if others:
        message = f'the goals are about "{tool}", though {_quoted(others)} could be the tool too'
        mended.warn(mended.xml.root, "robot", message, "`tool_frame` in robot.toml, or in --answers, names another")
    ask_who_stands(mended, tool, questions)
    merge_rigid(mended)
    joints = driven_joints(mended.model)
    if not joints:
        raise _NoArm("it has no joint that moves, so it is no arm", "name another file")
    has_motors = questions.ask(
        "motors", "does it have motors to drive (no: to plan and look at only)?",
        "yes" if motor or driver else "no", yes_or_no,
    )  # fmt: skip
    drives = ask_drives(joints, questions, usual_motor, usual_driver) if has_motors else []
    return Description(mended, robot, _base(mended.model), tool, joints, drives)


def _tool(mended: Mended) -> str:
    """The link by default: where the SRDF's largest chain ends, else by its name."""
    known = mended.semantics
    if known is None or not known.tip:
        return tool_link(mended.model)
    mended.say(mended.xml.root, f"{known.file}: robot", f'its largest chain ends at "{known.tip}"', "`tool_frame`")
    return known.tip


def _say_name(mended: Mended, name: str) -> None:
    if device_name(name) != name:
        message = f'"{name}" has {len(name)} letters, and a device has {MAX_NAME} at most'
        mended.say(mended.xml.root, "robot", message, f'its device is "{device_name(name)}"; --name gives another')


def _dense(mended: Mended) -> None:
    """Meshes of so many triangles that they are written coarser."""
    said: set[str | None] = set()
    for link, _, _, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and known.triangles > MOST_TRIANGLES and geometry.mesh not in said:
            said.add(geometry.mesh)
            message = f'mesh "{geometry.mesh}" has {known.triangles} triangles, more than {MOST_TRIANGLES}'
            mended.say(mesh, subject_of(link), message, "its copy is made coarser, to draw it and to fit shapes to it")


def _part(named: Callable[[str], MotorPart | DriverPart], text: str) -> str:
    try:
        return str(named(text).name)
    except ValueError as problem:
        raise DescriptionError(str(problem)) from problem


def _link_of(model: UrdfModel) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in model.link_names:
            raise ValueError(f"no such link{suggestion(text, model.link_names)}")
        return text

    return read


def _base(model: UrdfModel) -> str:
    children = {joint.child for joint in model.joints}
    return next(link for link in model.link_names if link not in children)


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


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
