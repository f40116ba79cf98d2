"""The folder that an import writes: meshes, robot.urdf, robot.toml, and robot.srdf with the results of sampling."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from schemas.text_file import read_text
from services.arm.checks.meshes import MeshFacts
from services.arm.errors import DescriptionError
from services.arm.model.description import load_arm
from services.arm.model.srdf_edit import entries, with_pairs
from services.arm.model.urdf import UrdfJoint, UrdfLink, UrdfModel
from services.robot_import.drive import JointDrive, bare_toml, driven_toml
from services.robot_import.mended import Mended
from services.robot_import.mesh_copies import copy_meshes
from services.robot_import.poses import named_states, srdf_text, zero_state

# [m] chosen: what shapes that are fitted to meshes may stand beyond them. Links that are never farther apart than this
# beyond the clearance are parts of one hinge, whose true distance such shapes cannot tell.
EXCESS, EXCESS_SHARE = 0.005, 0.01  # the latter of the longest mesh
# Of the steps in processes of their own: with matrices of three columns the threads of BLAS cost a fourth more CPU.
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}
COMMAND_LINE = "services.cli.main"  # its steps in a process of their own: they load the planner


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
        rest = driven_toml(self.drives, self.name, reference) if self.drives else bare_toml(self.joints, reference)
        return f"{heading}\n{rest}"


def write_robot(folder: Path, description: Description) -> None:
    """Fills the empty `folder`, each step with its time; raises `DescriptionError`."""
    with step("meshes and robot.urdf"):
        model = description.mended.model  # before `_write_urdf` replaces collision shapes
        _write_urdf(folder, description.mended, description.name, model)
    joints, zero = [joint.name for joint in description.joints], zero_state(description.joints)
    (folder / "robot.srdf").write_text(srdf_text(description.name, joints, {"home": zero}), encoding="utf-8")
    (folder / "robot.toml").write_text(description.robot_toml(zero), encoding="utf-8")
    _collisions(folder, description.mended, model)
    with step("home and ready, where nothing touches"):
        home = _write_states(folder)
        (folder / "robot.toml").write_text(description.robot_toml(home), encoding="utf-8")


@contextmanager
def step(what: str) -> Iterator[None]:
    """Says what is done, and how long it took."""
    print(f"{what} ...", flush=True)
    began = time.monotonic()
    yield
    print(f"{what}: {time.monotonic() - began:.1f} s", flush=True)


def _write_urdf(folder: Path, mended: Mended, name: str, model: UrdfModel) -> None:
    root = mended.xml.root
    root.set("name", name)
    for link, known in zip(root.findall("link"), model.links, strict=True):
        _prepare_collisions(link, known)
    copy_meshes(mended, folder)
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    (folder / "robot.urdf").write_text(text, encoding="utf-8")


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


def _collisions(folder: Path, mended: Mended, model: UrdfModel) -> None:
    """Shapes around the meshes, and the pairs of links that need no check."""
    links = [link.name for link in model.links if _is_fitted(link)]
    if links:
        with step(f"collision shapes for {len(links)} links"):
            _run("collision", "fit", str(folder), "--meshes", "--write", "--link", *links)
    with step("pairs of links that need no check"):
        excess = max(EXCESS, EXCESS_SHARE * _longest(mended, model))
        within = f"{1000.0 * (load_arm(folder).clearance + excess):.3g}mm"
        _run("collision", "matrix", str(folder), "--write", *(["--always-within", within] if links else []))


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
        raise DescriptionError(f"gemelo {' '.join(words)} failed: {done.stdout.strip() or 'see above'}")


def _write_states(folder: Path) -> dict[str, float]:
    """The SRDF anew with states that are free of contact, and the pairs that are in it; returns `home` [rad] or [m]."""
    arm = load_arm(folder)
    before = read_text(arm.srdf_path)
    pairs = {(first, second): entry.reason for entry in entries(before) for first, second in [sorted(entry.pair)]}
    states = named_states(arm)
    text = srdf_text(arm.name, arm.joint_names, states)
    arm.srdf_path.write_text(with_pairs(text, pairs), encoding="utf-8")
    return states["home"]
