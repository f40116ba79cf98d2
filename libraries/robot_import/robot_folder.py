"""The folder that an import writes: meshes, robot.urdf, robot.toml, and robot.srdf with the results of sampling."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gemelo.libraries.arm.checks.findings import Finding, Severity, note
from gemelo.libraries.arm.checks.meshes import MeshFacts
from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.srdf_edit import entries, with_pairs
from gemelo.libraries.arm.model.urdf import UrdfJoint, UrdfLink, UrdfModel
from gemelo.libraries.arm.model.virtual_drive import device_name
from gemelo.libraries.robot_import.drive import JointDrive, bare_toml, driven_toml
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mesh_copies import copy_meshes
from gemelo.libraries.robot_import.pairs import ONE_THREAD, sampled_pairs, write_pairs
from gemelo.libraries.robot_import.poses import NamedStates, named_states, srdf_text, zero_state
from gemelo.libraries.robot_import.semantics import srdf_lines
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.text_file import read_text

# [m] chosen: what shapes that are fitted to meshes may stand beyond them. Links that are never farther apart than this
# beyond the clearance are parts of one hinge, whose true distance such shapes cannot tell.
EXCESS, EXCESS_SHARE = 0.005, 0.01  # the latter of the longest mesh
COMMAND_LINE = "gemelo.tools.cli.main"  # its steps in a process of their own: they load the planner


@dataclass(frozen=True)
class Description:
    """All that the folder is written from: the mended source and what a person answered."""

    mended: Mended
    name: str
    base: str  # link
    tool: str  # link
    joints: Sequence[UrdfJoint]  # those with a motor, from the root outwards
    drives: Sequence[JointDrive]  # of `joints`; none for an arm without motors

    def robot_toml(self, reference: Mapping[str, float]) -> str:
        """robot.toml; `reference` [rad] or [m] is where `gemelo reference` declares each joint to be."""
        heading = "# Written by `gemelo import`; docs/my_own_arm.md says what each key is.\n"
        for key, value in (("name", self.name), ("base_frame", self.base), ("tool_frame", self.tool)):
            heading += f"{key} = {json.dumps(value)}\n"
        given = self.mended.accelerations
        if self.drives:
            rest = driven_toml(self.drives, device_name(self.name), reference, given)
        else:
            rest = bare_toml(self.joints, reference, given)
        return f"{heading}\n{rest}"


def write_robot(folder: Path, description: Description) -> list[Finding]:
    """Fills the empty `folder`, each step with its time, and returns what is to be said of the result; raises
    `DescriptionError`."""
    mended = description.mended
    say = mended.questions.say
    with step(because("import.step.urdf"), say):
        model = mended.model  # before `_write_urdf` replaces collision shapes
        _write_urdf(folder, mended, description.name, model)
    joints, zero = [joint.name for joint in description.joints], zero_state(description.joints)
    (folder / "robot.srdf").write_text(srdf_text(description.name, joints, {"home": zero}), encoding="utf-8")
    (folder / "robot.toml").write_text(description.robot_toml(zero), encoding="utf-8")
    findings = _collisions(folder, mended, model)
    if any(each.severity is Severity.ERROR for each in findings):
        return findings
    with step(because("import.step.states"), say):
        states = _write_states(folder, mended)
        (folder / "robot.toml").write_text(description.robot_toml(states.states["home"]), encoding="utf-8")
    return [*findings, *(note("robot.srdf", Subject("state", "home"), said) for said in states.said)]


@contextmanager
def step(what: Reason, say: Callable[[Reason], str]) -> Iterator[None]:
    """Says what is done, and how long it took, in the sentences that `say` makes."""
    print(say(because("import.step.begins", what)), flush=True)
    began = time.monotonic()
    yield
    print(say(because("import.step.done", what, seconds=time.monotonic() - began)), flush=True)


def _write_urdf(folder: Path, mended: Mended, name: str, model: UrdfModel) -> None:
    root = mended.xml.root
    root.set("name", name)
    for link, known in zip(root.findall("link"), model.links, strict=True):
        if mended.fits_bare and not known.collisions and not _is_fitted(known, mended):
            _touch_as_drawn(link)
    copy_meshes(mended, folder)
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    (folder / "robot.urdf").write_text(text, encoding="utf-8")


def _touch_as_drawn(element: ET.Element) -> None:
    """A drawing of boxes and cylinders serves as collision shape too."""
    for visual in element.findall("visual"):
        collision = ET.SubElement(element, "collision")
        collision.extend(ET.fromstring(ET.tostring(part)) for part in visual if part.tag in ("origin", "geometry"))


def _is_fitted(link: UrdfLink, mended: Mended) -> bool:
    """True if its own collision shapes have a mesh, or it has none, is drawn with a mesh, and is to get some."""
    drawn = any(visual.mesh is not None for visual in link.visuals)
    if link.collisions:
        return any(shape.mesh is not None for shape in link.collisions)
    return drawn and mended.fits_bare


def _collisions(folder: Path, mended: Mended, model: UrdfModel) -> list[Finding]:
    """Shapes around the meshes, and the pairs of links that need no check."""
    links = [link.name for link in model.links if _is_fitted(link, mended)]
    if links:
        with step(because("import.step.shapes", count=len(links)), mended.questions.say):
            _run("collision", "fit", str(folder), "--meshes", "--write", "--link", *links)
    with step(because("import.step.pairs"), mended.questions.say):
        arm = load_arm(folder)
        excess = max(EXCESS, EXCESS_SHARE * _longest(mended, model))
        pairs = sampled_pairs(folder, arm.clearance + excess if links else None)
        return list(write_pairs(arm, pairs, mended))


def _longest(mended: Mended, model: UrdfModel) -> float:
    """[m] along the longest mesh that a link is drawn with."""
    drawn = ((visual, mended.facts(visual)) for link in model.links for visual in link.visuals)
    lengths = (facts.longest * max(map(abs, each.scale)) for each, facts in drawn if isinstance(facts, MeshFacts))
    return max(lengths, default=0.0)


def _run(*words: str) -> None:
    """A command of the command line; what it says is shown where it fails."""
    command, environment = [sys.executable, "-m", COMMAND_LINE, *words], {**ONE_THREAD, **os.environ}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    if done.returncode:
        command_line = f"gemelo {' '.join(words)}"
        if printed := done.stdout.strip():
            raise DescriptionError(because("import.command.failed", command=command_line, printed=printed))
        raise DescriptionError(because("import.command.ended", command=command_line))


def _write_states(folder: Path, mended: Mended) -> NamedStates:
    """The SRDF anew with states that are free of contact, those of the owner's SRDF, and the pairs that are in it."""
    arm = load_arm(folder)
    before = read_text(arm.srdf_path)
    pairs = {(first, second): entry.reason for entry in entries(before) for first, second in [sorted(entry.pair)]}
    known = mended.semantics
    given = {name: known.state(name, arm.joint_names) for name in ("home", "ready")} if known else {}
    found = named_states(arm, {name: values for name, values in given.items() if values})
    more = srdf_lines(known, arm.joint_names, found.states) if known else []
    text = srdf_text(arm.name, arm.joint_names, found.states, more)
    arm.srdf_path.write_text(with_pairs(text, pairs), encoding="utf-8")
    return found
