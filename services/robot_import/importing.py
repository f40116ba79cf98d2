"""`gemelo import`: from a URDF or an export's folder to urdf/<name>/, each step with its time."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from services.arm.checks.check import check
from services.arm.checks.findings import Finding, Severity
from services.arm.errors import DescriptionError, suggestion
from services.arm.model.description import load_arm
from services.arm.model.srdf_edit import entries, with_pairs
from services.arm.model.urdf import UrdfJoint, UrdfLink, UrdfModel
from services.arm.model.virtual_drive import NO_MOTORS, driven_joints
from services.robot_import.drive import ask_drives, bare_toml, driven_toml, speed_lines
from services.robot_import.limits import ask_limits
from services.robot_import.mending import Mended, mend, safe_name
from services.robot_import.mesh_copies import copy_meshes
from services.robot_import.parts import MOTORS, USUAL_DRIVER, DriverPart, MotorPart, driver_named, motor_named
from services.robot_import.poses import named_states, srdf_text, zero_state
from services.robot_import.questions import Questions, answers_text, read_answers, yes_or_no
from services.robot_import.source import find_source

ANSWERS_FILE = "import.toml"
NOT_IN_A_NAME = r"[^A-Za-z0-9_-]+"
FOREIGN = ("gazebo", "transmission", "ros2_control", "sensor")  # elements that are no kinematics
TOOL_NAMES = ("tool0", "tcp", "tool", "ee_link", "end_effector", "flange", "hand")
COMMAND_LINE = "services.cli.main"  # its steps in a process of their own: they load the planner


@dataclass(frozen=True)
class ImportOptions:
    """What a person gave on the command line."""

    source: Path
    output: Path  # folder of robots
    name: str = ""
    yes: bool = False
    force: bool = False
    answers: Path | None = None
    motor: str = ""
    driver: str = ""


def import_robot(options: ImportOptions) -> Path:
    """Writes the robot's folder and returns it; raises `DescriptionError`, and leaves what was there as it was."""
    motor = _part(motor_named, options.motor or MOTORS[0].name)
    driver = _part(driver_named, options.driver or USUAL_DRIVER)
    questions = Questions(read_answers(options.answers) if options.answers else {}, options.yes)
    with _step("reading the source and its meshes"):
        source = find_source(options.source)
        trial = mend(source)
        ask_limits(trial, Questions({}, takes_defaults=True))
        _require_importable(trial.findings())
    mended = mend(source)
    ask_limits(mended, questions)
    _show(mended.findings())
    name = _name(options, mended)
    folder = options.output / name
    _require_free(folder, options)
    joints = driven_joints(mended.model)
    tool = questions.ask("tool_frame", "the tool's link", _tool(mended.model), _link_of(mended.model))
    has_motors = questions.ask(
        "motors", "does it have motors to drive (no: to plan and look at only)?",
        "yes" if options.motor or options.driver else "no", yes_or_no,
    )  # fmt: skip
    drives = ask_drives(joints, questions, motor, driver) if has_motors else []

    def robot_toml(reference: Mapping[str, float]) -> str:
        drive = driven_toml(drives, name, reference) if has_motors else bare_toml(joints, reference)
        return _heading(name, _base(mended.model), tool) + drive

    for unused in questions.unused():
        raise DescriptionError(f"{options.answers}: nothing asks for {unused}: correct or remove it")
    building = options.output / f".{name}.partial"
    shutil.rmtree(building, ignore_errors=True)
    building.mkdir(parents=True)
    try:
        _write_files(building, mended, name, joints)
        (building / "robot.toml").write_text(robot_toml(zero_state(joints)), encoding="utf-8")
        (building / ANSWERS_FILE).write_text(answers_text(questions.answers), encoding="utf-8")
        _collisions(building, mended.model)
        with _step("home and ready, where nothing touches"):
            home = _write_states(building)
            (building / "robot.toml").write_text(robot_toml(home), encoding="utf-8")
        with _step("gemelo check"):
            _require_well(check(building))
        shutil.rmtree(folder, ignore_errors=True)
        building.rename(folder)
    finally:
        shutil.rmtree(building, ignore_errors=True)
    arm = load_arm(folder)
    print("\n".join(speed_lines(arm) if arm.has_motors else [f"{name}: {NO_MOTORS}"]))
    return folder


@contextmanager
def _step(what: str) -> Iterator[None]:
    """Says what is done, and how long it took."""
    print(f"{what} ...", flush=True)
    began = time.monotonic()
    yield
    print(f"{what}: {time.monotonic() - began:.1f} s", flush=True)


def _part(named: Callable[[str], MotorPart | DriverPart], text: str) -> str:
    try:
        return str(named(text).name)
    except ValueError as error:
        raise DescriptionError(str(error)) from error


def _require_importable(findings: Sequence[Finding]) -> None:
    """Raises `DescriptionError` after all findings are said, where one of them is an error."""
    errors = [each for each in findings if each.severity is Severity.ERROR]
    if errors:
        _show(findings)
        raise DescriptionError(
            f"{len(errors)} errors above have no one answer: correct the source, then import it again"
        )


def _require_well(findings: Sequence[Finding]) -> None:
    """Raises `DescriptionError` where the finished folder has an error; says the rest, without notes."""
    _show([each for each in findings if each.severity is not Severity.NOTE])
    if any(each.severity is Severity.ERROR for each in findings):
        raise DescriptionError("the finished robot has the errors above; nothing is written")


def _show(findings: Sequence[Finding]) -> None:
    for finding in findings:
        mends = finding.severity is Severity.NOTE
        print(str(finding).replace("note: ", "mended: ", 1) if mends else finding)


def _name(options: ImportOptions, mended: Mended) -> str:
    wanted = options.name or mended.xml.root.get("name") or options.source.stem
    return safe_name(wanted, set(), NOT_IN_A_NAME)


def _require_free(folder: Path, options: ImportOptions) -> None:
    if not folder.exists():
        return
    if not options.force:
        raise DescriptionError(f"{folder} is there already: give --force to replace it, or --name for another")
    if folder.resolve() in (options.source.resolve(), *options.source.resolve().parents):
        raise DescriptionError(f"{options.source} lies in {folder}, which is to be replaced: give --name for another")


def _tool(model: UrdfModel) -> str:
    """A link with a tool's name, else the last one behind the longest chain of joints."""
    depths = {link.name: 0 for link in model.links}
    for _ in model.joints:
        for joint in model.joints:
            if joint.parent in depths and joint.child in depths:
                depths[joint.child] = depths[joint.parent] + 1
    for wanted in TOOL_NAMES:
        found = [link for link in depths if link.lower().rpartition("-")[2].endswith(wanted)]
        if found:
            return max(found, key=lambda link: depths[link])
    return max(depths, key=lambda link: depths[link])


def _link_of(model: UrdfModel) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in model.link_names:
            raise ValueError(f"no such link{suggestion(text, model.link_names)}")
        return text

    return read


def _base(model: UrdfModel) -> str:
    children = {joint.child for joint in model.joints}
    return next(link for link in model.link_names if link not in children)


def _heading(name: str, base: str, tool: str) -> str:
    keys = (("name", name), ("base_frame", base), ("tool_frame", tool))
    lines = "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys)
    return f"# Written by `gemelo import`; docs/my_own_arm.md says what each key is.\n{lines}\n"


def _write_files(folder: Path, mended: Mended, name: str, joints: Sequence[UrdfJoint]) -> None:
    """Meshes, URDF, and an SRDF with a `home` that may touch something."""
    model, root = mended.model, mended.xml.root
    with _step("meshes and robot.urdf"):
        root.set("name", name)
        for element in [each for each in root if each.tag in FOREIGN]:
            root.remove(element)
        for material in root.iter("material"):
            for texture in material.findall("texture"):
                material.remove(texture)
        for link, known in zip(root.findall("link"), model.links, strict=True):
            _prepare_collisions(link, known)
        copy_meshes(mended, folder)
        ET.indent(root)
        text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
        (folder / "robot.urdf").write_text(text, encoding="utf-8")
        srdf = srdf_text(name, [joint.name for joint in joints], {"home": zero_state(joints)})
        (folder / "robot.srdf").write_text(srdf, encoding="utf-8")


def _prepare_collisions(element: ET.Element, link: UrdfLink) -> None:
    """Shapes of a person's own stay; a drawing of boxes and cylinders serves as collision shape too."""
    if _is_fitted(link):
        for collision in element.findall("collision"):
            element.remove(collision)
    elif not link.collisions:
        for visual in element.findall("visual"):
            collision = ET.SubElement(element, "collision")
            collision.extend(ET.fromstring(ET.tostring(part)) for part in visual if part.tag in ("origin", "geometry"))


def _is_fitted(link: UrdfLink) -> bool:
    """True if it is drawn with a mesh and has no shapes but meshes."""
    drawn = any(visual.mesh is not None for visual in link.visuals)
    return drawn and (not link.collisions or any(shape.mesh is not None for shape in link.collisions))


def _collisions(folder: Path, model: UrdfModel) -> None:
    """Shapes around the meshes, and the pairs of links that need no check."""
    links = [link.name for link in model.links if _is_fitted(link)]
    if links:
        with _step(f"collision shapes for {len(links)} links"):
            _run("collision", "fit", str(folder), "--meshes", "--write", "--link", *links)
    with _step("pairs of links that need no check"):
        _run("collision", "matrix", str(folder), "--write")


def _run(*words: str) -> None:
    """A command of the command line; what it says is shown where it fails."""
    done = subprocess.run([sys.executable, "-m", COMMAND_LINE, *words], stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise DescriptionError(f"gemelo {' '.join(words)} failed: {done.stdout.strip() or 'see above'}")


def _write_states(folder: Path) -> dict[str, float]:
    """The SRDF anew with states that are free of contact, and the pairs that are in it; returns `home` [rad] or [m]."""
    arm = load_arm(folder)
    before = arm.srdf_path.read_text(encoding="utf-8")
    pairs = {(first, second): entry.reason for entry in entries(before) for first, second in [sorted(entry.pair)]}
    states = named_states(arm)
    text = srdf_text(arm.name, arm.joint_names, states)
    arm.srdf_path.write_text(with_pairs(text, pairs), encoding="utf-8")
    return states["home"]
