"""The figure of fitted collision shapes: how far they reach beyond the meshes of generated arms, and what it costs."""

from __future__ import annotations

import random
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import trimesh

from schemas.frames import Transform
from schemas.joints import JointState
from schemas.planning import JointGoal, PlanRequest
from schemas.scene import BoxShape, PlanningScene, SceneObject
from services.arm.kinematics.kinematics import Kinematics
from services.arm.model.description import Arm, load_arm
from services.arm.model.urdf_edit import with_collisions
from services.bench.figures import Figure, Goal, of_samples
from services.bench.import_time import LENGTH, export, part
from services.collision_fitting.fit_writing import write_fits
from services.collision_fitting.mesh_fit import LinkFit, fit_links
from services.planner.collision.world import World
from services.planner.core import Planner

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
    return of_samples(samples, Goal(p99=5.0), reference, note)


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


def imported(folder: Path, link: Callable[[int], trimesh.Trimesh]) -> Arm:
    """The robot that `gemelo import` makes of an arm with such links."""
    source = export(folder / "six_description", link)
    words = ("import", str(source), "--yes", "--output", str(folder))
    command = [sys.executable, "-m", "services.cli.main", *words]
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


def plans_solved(name: str, arm: Arm, fits: Fits) -> dict[str, float]:
    """[%] of problems between boxes solved, with the arm of one shape for each link and with the bounded one."""
    solids = with_meshes(arm)
    scene = crowded()
    problems = requests(solids, scene)
    found: dict[str, float] = {}
    for which, several in zip(("one shape", "bounded"), fits, strict=True):
        copy = write_fits(copied(arm, which), several)
        found[f"{name}, {which}: plans solved %"] = 100.0 * solved(copy, scene, problems) / len(problems)
    return found


def solved(arm: Arm, scene: PlanningScene, problems: list[PlanRequest]) -> int:
    """How many are planned."""
    planner = Planner(arm)
    planner.set_world(World(arm, planner.kinematics, scene))
    return sum(planner.plan(problem, None).refusal is None for problem in problems)


def copied(arm: Arm, name: str) -> Arm:
    """The same robot in a folder of its own."""
    folder = arm.folder.parent / name
    shutil.copytree(arm.folder, folder)
    return load_arm(folder)


def with_meshes(arm: Arm) -> Arm:
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


def requests(arm: Arm, scene: PlanningScene) -> list[PlanRequest]:
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
