"""Figures of `gemelo import`: how long it takes, and how far the shapes that it fits reach beyond their meshes."""

from __future__ import annotations

import math
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import trimesh

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.urdf_edit import with_collisions
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples
from gemelo.tools.collision_fitting.fit_writing import write_fits
from gemelo.tools.collision_fitting.mesh_fit import LinkFit, fit_links

PROBLEMS, SEED = 8, 6
ALLOWED = 1.0  # [s] for a plan
CLEAR = 0.012  # [m] that start and goal stand from everything, by the meshes themselves
WIDTH, THICKNESS = 60.0, 16.0  # [mm] of a bracket


class Fits(NamedTuple):
    """Of one arm: the excess of one shape for each link, and of as many as the bound takes."""

    one: list[LinkFit]
    bounded: list[LinkFit]


def fit_excess_mm() -> Figure:
    """How far [mm] 95 % of the surface of a link's shapes stays within the mesh, links of two generated arms."""
    reference: dict[str, float] = {}
    samples: list[float] = []
    with tempfile.TemporaryDirectory() as temporary:
        for name, link in (("tubes", part), ("brackets", bracket)):
            arm = imported(Path(temporary) / name, link)
            fits = Fits(fit_links(arm, most=1), fit_links(arm))
            samples += [1e3 * fit.excess.p95 for fit in fits.bounded]
            reference |= compared(name, fits) | plans_solved(name, arm, fits)
    note = f"two arms of 6 joints, bound 5 mm; {PROBLEMS} problems each whose ends are {1e3 * CLEAR:g} mm free by mesh"
    return of_samples(samples, FigureGoal(p99=5.0), reference, note)


def bracket(index: int) -> trimesh.Trimesh:
    """A link [mm] along z: a channel that is open to one side, of one body."""
    size = WIDTH - 4.0 * index
    outer = trimesh.creation.box((size, size, LENGTH))
    inner = trimesh.creation.box((size, size - 2.0 * THICKNESS, LENGTH - 2.0 * THICKNESS))
    inner.apply_translation((THICKNESS, 0.0, 0.0))
    whole = trimesh.boolean.difference([outer, inner])
    whole.apply_translation((0.0, 0.0, LENGTH / 2))
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def imported(folder: Path, link: Callable[[int], trimesh.Trimesh]) -> ArmDescription:
    """The robot that `gemelo import` makes of an arm with such links."""
    source = export(folder / "six_description", link)
    words = ("import", str(source), "--yes", "--output", str(folder))
    command = [sys.executable, "-m", "gemelo.tools.cli.main", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return load_arm(folder / "six")


def compared(name: str, fits: Fits) -> dict[str, float]:
    """p95 and worst [mm], and the number of shapes of a link."""
    found: dict[str, float] = {}
    for which, several in zip(("one shape", "bounded"), fits, strict=True):
        found[f"{name}, {which}: p95"] = max(1e3 * fit.excess.p95 for fit in several)
        found[f"{name}, {which}: worst"] = max(1e3 * fit.excess.worst for fit in several)
    found[f"{name}: shapes a link"] = statistics.mean(len(fit.shapes) for fit in fits.bounded)
    return found


def plans_solved(name: str, arm: ArmDescription, fits: Fits) -> dict[str, float]:
    """[%] of problems between boxes solved, with the arm of one shape for each link and with the bounded one."""
    solids = with_meshes(arm)
    scene = crowded()
    problems = requests(solids, scene)
    found: dict[str, float] = {}
    for which, several in zip(("one shape", "bounded"), fits, strict=True):
        copy = write_fits(copied(arm, which), several)
        found[f"{name}, {which}: plans solved %"] = 100.0 * solved(copy, scene, problems) / len(problems)
    return found


def solved(arm: ArmDescription, scene: PlanningScene, problems: list[PlanRequest]) -> int:
    """How many are planned."""
    planner = Planner(arm)
    planner.set_world(World(arm, planner.kinematics, scene))
    return sum(planner.plan(problem, None).refusal is None for problem in problems)


def copied(arm: ArmDescription, name: str) -> ArmDescription:
    """The same robot in a folder of its own."""
    folder = arm.folder.parent / name
    shutil.copytree(arm.folder, folder)
    return load_arm(folder)


def with_meshes(arm: ArmDescription) -> ArmDescription:
    """The same robot with its meshes as they are as collision shapes: what is true."""
    copy = copied(arm, "meshes")
    blocks = {
        link.name: [
            f'<collision><geometry><mesh filename="{visual.mesh}" scale="0.001 0.001 0.001"/></geometry></collision>'
            for visual in link.visuals
        ]
        for link in copy.model.links
    }
    copy.urdf_path.write_text(with_collisions(copy.urdf_path.read_text(), blocks))
    return load_arm(copy.folder)


def crowded() -> PlanningScene:
    """Boxes all around the arm, the same ones in every run."""
    generator, boxes = random.Random(SEED), list[SceneObject]()
    while len(boxes) < 14:
        x, y, z = (generator.uniform(-0.7, 0.7), generator.uniform(-0.7, 0.7), generator.uniform(0.0, 1.4))
        if max(abs(x), abs(y)) > 0.22:
            shape, pose = BoxShape(size=(0.1, 0.1, 0.1)), Transform(translation=(x, y, z))
            boxes.append(SceneObject(name=f"box_{len(boxes)}", shape=shape, pose=pose))
    return PlanningScene(version=1, objects=tuple(boxes))


def requests(arm: ArmDescription, scene: PlanningScene) -> list[PlanRequest]:
    """Between configurations that stand near something: at most three times `CLEAR`."""
    world, generator = World(arm, Kinematics(arm), scene), random.Random(SEED)
    found: list[tuple[float, ...]] = []
    while len(found) < 2 * PROBLEMS:
        configuration = tuple(generator.uniform(joint.lower, joint.upper) for joint in arm.joints)
        if CLEAR < world.distance(configuration) < 3.0 * CLEAR:
            found.append(configuration)
    return [
        PlanRequest(
            start=JointState(name=arm.joint_names, position=start),
            goal=JointGoal(name=arm.joint_names, position=goal),
            allowed_time=ALLOWED,
        )
        for start, goal in zip(found[::2], found[1::2], strict=True)
    ]


RUNS = 3
JOINTS = 6
BOLTS = 100
LENGTH, GAP = 180.0, 30.0  # [mm] of a link, and between two
LIMIT = '<limit lower="-2.6" upper="2.6" effort="20" velocity="2"/>'


def import_s() -> Figure:
    """Time [s] of one import whose questions are answered by defaults, in turn of an arm of light meshes and of one of
    heavy ones; the reference is a check of what it wrote."""
    took: dict[str, list[float]] = {"light": [], "heavy": []}
    with tempfile.TemporaryDirectory() as temporary:
        sources = {
            name: export(Path(temporary) / name / "six_description", link)
            for name, link in (("light", part), ("heavy", heavy_part))
        }
        for run in range(RUNS):
            for name, source in sources.items():
                output = Path(temporary) / name / f"run_{run}"
                took[name].append(_seconds("import", str(source), "--yes", "--output", str(output)))
        check = _seconds("check", str(output / "six"))
    reference = {f"{name} meshes": statistics.median(seconds) for name, seconds in took.items()}
    triangles = f"{len(part(0).faces)} and {len(heavy_part(0).faces)} triangles"
    note = f"two arms of {JOINTS} joints, {JOINTS + 1} links of {triangles} each; {RUNS} runs of both"
    samples = [each for seconds in took.values() for each in seconds]
    return of_samples(samples, FigureGoal(median=20.0), {**reference, "gemelo check of the heavy one": check}, note)


def part(index: int) -> trimesh.Trimesh:
    """A link [mm] along z as CAD programs give it: a tube, a motor across it, a plate and a ball, in one file."""
    radius = 40.0 - 3.0 * index
    tube = trimesh.creation.cylinder(radius=radius, height=LENGTH, sections=64)
    motor = trimesh.creation.cylinder(radius=0.7 * radius, height=2.6 * radius, sections=64)
    motor.apply_transform(trimesh.transformations.rotation_matrix(1.5708, (1.0, 0.0, 0.0)))
    plate = trimesh.creation.box((2.4 * radius, 1.2 * radius, 8.0)).subdivide().subdivide()
    plate.apply_translation((0.0, 0.0, LENGTH / 2 - 4.0))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.8 * radius)
    ball.apply_translation((0.0, 0.0, -LENGTH / 4))
    whole = trimesh.util.concatenate([tube, motor, plate, ball])
    whole.apply_translation((0.0, 0.0, LENGTH / 2))
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def heavy_part(index: int) -> trimesh.Trimesh:
    """A link [mm] along z with all that CAD draws: a housing with a front and a back, but no hidden bottom, a motor
    across it, and a hundred bolts."""
    radius = 40.0 - 3.0 * index
    housing = trimesh.creation.cylinder(radius=radius, height=LENGTH, sections=96)
    for _ in range(3):
        housing = housing.subdivide()
    housing.update_faces(~(housing.triangles[:, :, 2] < 1.0 - LENGTH / 2).all(axis=1))
    back = housing.copy()
    back.invert()
    motor = trimesh.creation.cylinder(radius=0.7 * radius, height=2.6 * radius, sections=96).subdivide()
    motor.apply_transform(trimesh.transformations.rotation_matrix(1.5708, (1.0, 0.0, 0.0)))
    whole = trimesh.util.concatenate([housing, back, motor, *_bolts(radius)])
    whole.apply_translation((0.0, 0.0, LENGTH / 2))
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def _bolts(radius: float) -> list[trimesh.Trimesh]:
    """Half sunk into the housing, in rings."""
    bolts = []
    for number in range(BOLTS):
        bolt = trimesh.creation.icosphere(subdivisions=2, radius=2.5)
        turn, height = 2.0 * math.pi * (number % 20) / 20, LENGTH * (number // 20 / (BOLTS / 20) - 0.45)
        bolt.apply_translation((radius * math.cos(turn), radius * math.sin(turn), height))
        bolts.append(bolt)
    return bolts


def export(folder: Path, link: Callable[[int], trimesh.Trimesh] = part) -> Path:
    """A ROS package with meshes [mm], which `link` gives for each number, and package:// paths."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    (folder / "package.xml").write_text(f'<package format="2"><name>{folder.name}</name></package>\n')
    names = [f"link_{index}" for index in range(JOINTS + 1)]
    for index, name in enumerate(names):
        link(index).export(folder / "meshes" / f"{name}.stl")
    lines = ['<?xml version="1.0"?>', '<robot name="six">', *(_link(folder.name, name) for name in names)]
    for index, (parent, child) in enumerate(pairwise(names)):
        axis = "0 0 1" if index in (0, 3, 5) else "0 1 0"
        lines.append(
            f'<joint name="joint_{index + 1}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0 {(LENGTH + GAP) / 1000.0}"/><axis xyz="{axis}"/>{LIMIT}</joint>'
        )
    (folder / "urdf" / "six.urdf").write_text("\n".join([*lines, "</robot>"]))
    return folder


def _link(package: str, name: str) -> str:
    shape = f'<geometry><mesh filename="package://{package}/meshes/{name}.stl" scale="0.001 0.001 0.001"/></geometry>'
    return f'<link name="{name}"><visual>{shape}</visual><collision>{shape}</collision></link>'


def _seconds(*words: str) -> float:
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "gemelo.tools.cli.main", *words], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began
