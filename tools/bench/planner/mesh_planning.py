"""Figures of raw meshes of a hundred thousand triangles: plans around such an obstacle, and the first plan of an arm
whose links are such meshes, with nothing on the disk and at the next start."""

from __future__ import annotations

import os
import random
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest, PlanResponse
from gemelo.schemas.scene import MeshShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.any_arm.drawn_problems import problems
from gemelo.tools.bench.any_arm.generated_arms import generated_arm
from gemelo.tools.bench.figures import Figure, of_samples, quantile
from gemelo.tools.bench.planner.any_planning import planned
from gemelo.tools.bench.planner.trials import spread
from gemelo.tools.bench.problems.problem_sets import ALLOWED
from gemelo.tools.bench.scenes import TABLE, parol6

Array = NDArray[np.float64]

RINGS, SECTORS = 225, 225  # 100,800 triangles
RADIUS, DENTS = 0.08, 0.02  # [m]
PLACE = (0.28, 0.12, 0.16)  # [m] in front of the arm
PROBLEMS, WARMING, SEED = 40, 2, 4
STARTS = 3  # warm ones
IMPORTED, FEW = ("table pick", "box", "three shelves"), 12  # families, and problems of each
LINKS = ("base_link", "brazo_link", "efector_link")
HEIGHTS = (-2.0, 2.0, 0.9)  # [m] of the rocks in their links, where they touch nothing
LINK = """
  <link name="{parent}_rock">
    <collision>
      <origin xyz="0 0 {z}"/>
      <geometry><mesh filename="rock.stl" scale="{scale} {scale} {scale}"/></geometry>
    </collision>
  </link>
  <joint name="{parent}_rock_joint" type="fixed"><parent link="{parent}"/><child link="{parent}_rock"/></joint>
"""
PROGRAM = """
import sys, time
from pathlib import Path
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.core import Planner
began = time.process_time()
arm = load_arm(Path(sys.argv[1]))
planner = Planner(arm)
planner.prepare()
start = JointState(name=arm.joint_names, position=arm.named_states["home"])
response = planner.plan(PlanRequest(goal=NamedGoal(name="ready"), start=start, allowed_time=100.0), None)
assert response.code is PlanCode.SUCCESS, response.refusal
print(time.process_time() - began)
"""


def plan_mesh_ms() -> Figure:
    """Time of one plan [ms] around a dented ball of 100,800 triangles; some problems may have no solution."""
    scene = PlanningScene(version=1, objects=(TABLE, dented_ball()))
    planner = Planner(parol6())
    planner.prepare()
    began = time.perf_counter()
    world = World(planner.arm, planner.kinematics, scene)
    loaded = (time.perf_counter() - began) * 1e3
    planner.set_world(world)
    done = [timed_plan(planner, request) for request in random_requests(planner.arm, world)]
    answers = done[WARMING:]
    searched = [took for took, answer in answers if answer.refusal is None and answer.planner_id != "straight"]
    reference = {"the scene taken in": loaded, "the first plan in it": done[0][0]}
    reference |= spread("searched", searched, 0.5, 0.99)
    reference["solved %"] = 100.0 * sum(answer.refusal is None for _, answer in answers) / len(answers)
    reference |= as_imported()
    note = (
        f"parol6, a table and a rock of {triangles()} triangles, {PROBLEMS} random problems, {len(searched)} searched"
    )
    return of_samples([took for took, _ in answers], None, reference, note)


def as_imported() -> dict[str, float]:
    """Times of the CPU [ms] of plans for an arm with hand-made solids and for the same as a stranger imports it, whose
    links are raw meshes; and how many times as long."""
    reference: dict[str, float] = {}
    samples: dict[str, list[float]] = {}
    for name in ("six", "six_raw"):
        planner = Planner(generated_arm(name))
        planner.prepare()
        some = [problem for family in IMPORTED for problem in problems(planner.arm, planner.kinematics, family, FEW)]
        for problem in some[:WARMING]:
            planned(planner, problem)
        done = [planned(planner, problem) for problem in some]
        samples[name] = [worked for response, worked, _ in done if response.refusal is None]
        reference |= spread(name, samples[name], 0.5, 0.99)
        reference[f"{name}, solved %"] = 100.0 * len(samples[name]) / len(some)
    for share in (0.5, 0.99):
        ratio = quantile(samples["six_raw"], share) / quantile(samples["six"], share)
        reference[f"six_raw as a share of six, p{100 * share:.0f}"] = ratio
    return reference


def first_plan_s() -> Figure:
    """Time of the CPU [s] from a robot's folder to its first plan, in a new process, with its models on the disk."""
    with tempfile.TemporaryDirectory() as temporary:
        folder, kept = rocky(Path(temporary) / "rm1"), Path(temporary) / "cache"
        cold = first_plan(folder, kept)
        warm = [first_plan(folder, kept) for _ in range(STARTS)]
        plain = first_plan(project_root() / "urdf/rm1", kept)
    reference = {
        "cold": cold,
        "warm as a share of cold": statistics.median(warm) / cold,
        "rm1 as it is, of solids": plain,
    }
    note = f"rm1 with a rock of 100,800 triangles on {len(LINKS)} links, of three sizes; {STARTS} warm starts"
    return of_samples(warm, None, reference, note)


def timed_plan(planner: Planner, request: PlanRequest) -> tuple[float, PlanResponse]:
    """The time of one plan [ms] and its response."""
    began = time.perf_counter()
    response = planner.plan(request, None, clock=time.perf_counter)
    return (time.perf_counter() - began) * 1e3, response


def random_requests(arm: ArmDescription, world: World) -> list[PlanRequest]:
    """Requests from one free configuration to another; the same ones in every run."""
    generator, free = random.Random(SEED), list[tuple[float, ...]]()
    while len(free) < 2 * (PROBLEMS + WARMING):
        configuration = tuple(generator.uniform(joint.lower, joint.upper) for joint in arm.joints)
        if world.distance(configuration) > CLEARANCE:
            free.append(configuration)
    return [
        PlanRequest(
            start=JointState(name=arm.joint_names, position=start),
            goal=JointGoal(name=arm.joint_names, position=goal),
            allowed_time=ALLOWED,
        )
        for start, goal in zip(free[::2], free[1::2], strict=True)
    ]


def triangles() -> int:
    """Number of triangles of `dented_ball`."""
    return 2 * SECTORS * (RINGS - 1)


def dented_ball() -> SceneObject:
    """A dented ball as a binary STL [m]."""
    polar = np.linspace(0.0, np.pi, RINGS + 1)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, SECTORS + 1)[None, :]
    radius = RADIUS + DENTS * np.sin(7.0 * polar) * np.sin(9.0 * around)
    height = np.cos(polar) * np.ones_like(around)
    points = radius[..., None] * np.stack((np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), height), -1)
    points[:, -1] = points[:, 0]
    points[[0, -1], :, :2] = 0.0
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    corners = np.concatenate(
        (np.stack((a, b, c), -2)[:-1].reshape(-1, 3, 3), np.stack((a, c, d), -2)[1:].reshape(-1, 3, 3))
    )
    facets = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets["corners"] = corners
    content = bytes(80) + struct.pack("<I", len(facets)) + facets.tobytes()
    return SceneObject(name="rock", shape=MeshShape(data=content), pose=Transform(translation=PLACE))


def rocky(folder: Path) -> Path:
    """A copy of rm1 with rocks that touch nothing."""
    shutil.copytree(project_root() / "urdf/rm1", folder)
    shape = dented_ball().shape
    assert isinstance(shape, MeshShape)
    (folder / "rock.stl").write_bytes(shape.data)
    urdf = folder / "robot.urdf"
    added = [LINK.format(parent=link, z=HEIGHTS[index], scale=1.0 - 0.1 * index) for index, link in enumerate(LINKS)]
    urdf.write_text(urdf.read_text().replace("</robot>", "".join(added) + "</robot>"))
    return folder


def first_plan(folder: Path, kept: Path) -> float:
    """[s] of the CPU, by a process that finds its models in `kept`, or makes them."""
    environment = {**os.environ, "GEMELO_CACHE": str(kept), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", PROGRAM, str(folder)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return float(done.stdout)
