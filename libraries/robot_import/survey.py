"""The findings of a source before anything is built: one list for `gemelo check` and `gemelo import`."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass

from gemelo.libraries.arm.checks.findings import Finding, Severity, error
from gemelo.libraries.arm.checks.meshes import MOST_TRIANGLES, MeshFacts
from gemelo.libraries.arm.errors import DescriptionError, Subject, nearest
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
from gemelo.libraries.robot_import.questions import BadAnswer, Questions, yes_or_no
from gemelo.libraries.robot_import.robot_folder import Description
from gemelo.libraries.robot_import.semantics import semantics
from gemelo.libraries.robot_import.source import RobotSource
from gemelo.libraries.robot_import.standing import ask_who_stands
from gemelo.libraries.robot_import.tool_link import other_tools, tool_link
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Value, because, remedy

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
        findings = [error(source.label, Subject("robot"), why.reason, mended.xml.lines.get(mended.xml.root, 0))]
        return Survey([*findings, *mended.findings()], None)
    return Survey(mended.findings(), description)


class _NoArm(ReasonedError):
    """Why nothing can be built of a source, and what would do."""


def _described(mended: Mended, questions: Questions, name: str, motor: str, driver: str) -> Description:
    """With what a URDF cannot say, asked."""
    wanted = name or mended.xml.root.get("name") or mended.source.urdf.stem
    robot = safe_name(wanted[:LONGEST_NAME], set(), NOT_IN_A_NAME)
    _say_name(mended, robot)
    usual_motor = _part(motor_named, motor or MOTORS[0].name)
    usual_driver = _part(driver_named, driver or USUAL_DRIVER)
    tool = questions.ask("tool_frame", because("import.ask.tool"), _tool(mended), _link_of(mended.model))
    others = other_tools(mended.model, tool)
    if others:
        what = because("mend.tool.others", remedy("other_tool_frame"), tool=tool, others=tuple(others))
        mended.warn(mended.xml.root, Subject("robot"), what)
    ask_who_stands(mended, tool, questions)
    merge_rigid(mended)
    joints = driven_joints(mended.model)
    if not joints:
        raise _NoArm(because("mend.robot.no_joint", remedy("name_another_file")))
    has_motors = questions.ask("motors", because("import.ask.motors"), "yes" if motor or driver else "no", yes_or_no)
    drives = ask_drives(joints, questions, usual_motor, usual_driver) if has_motors else []
    return Description(mended, robot, _base(mended.model), tool, joints, drives)


def _tool(mended: Mended) -> str:
    """The link by default: where the SRDF's largest chain ends, else by its name."""
    known = mended.semantics
    if known is None or not known.tip:
        return tool_link(mended.model)
    what = because("mend.tool.chain", remedy("written", text="`tool_frame`"), link=known.tip)
    mended.say(mended.xml.root, Subject("robot", within=known.file), what)
    return known.tip


def _say_name(mended: Mended, name: str) -> None:
    if device_name(name) != name:
        mend = remedy("device_is_named", device=device_name(name))
        what = because("mend.robot.name", mend, name=name, letters=len(name), most=MAX_NAME)
        mended.say(mended.xml.root, Subject("robot"), what)


def _dense(mended: Mended) -> None:
    """Meshes of so many triangles that they are written coarser."""
    said: set[str | None] = set()
    for link, _, _, geometry, mesh in meshes_of(mended):
        known = mended.facts(geometry)
        if isinstance(known, MeshFacts) and known.triangles > MOST_TRIANGLES and geometry.mesh not in said:
            said.add(geometry.mesh)
            counts: dict[str, Value] = {"triangles": known.triangles, "most": MOST_TRIANGLES}
            what = because("mend.mesh.triangles", remedy("coarser_copy"), mesh=geometry.mesh or "", **counts)
            mended.say(mesh, subject_of(link), what)


def _part(named: Callable[[str], MotorPart | DriverPart], text: str) -> str:
    try:
        return str(named(text).name)
    except BadAnswer as problem:
        raise DescriptionError(problem.reason) from problem


def _link_of(model: UrdfModel) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in model.link_names:
            raise BadAnswer(because("import.answer.no_link", nearest(text, model.link_names)))
        return text

    return read


def _base(model: UrdfModel) -> str:
    children = {joint.child for joint in model.joints}
    return next(link for link in model.link_names if link not in children)


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
        what = because("mend.link.fixed", remedy("drawn_as_one"), count=count, links=len(links))
        mended.say(elements[root], subject_of(elements[root]), what)


def _give(link: ET.Element, item: ET.Element, pose: Rigid) -> None:
    set_origin(item, pose)
    link.append(item)
