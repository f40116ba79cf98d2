"""The figure of the first plan of an arm whose links are raw meshes, with nothing on the disk and at the next start."""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from schemas.scene import MeshShape
from services.bench.figures import Figure, of_samples
from services.bench.mesh_planning import dented_ball
from services.runtime.deployment import project_root

STARTS = 3  # warm ones
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
from schemas.joints import JointState
from schemas.planning import NamedGoal, PlanCode, PlanRequest
from services.arm.model.description import load_arm
from services.planner.core import Planner
began = time.process_time()
arm = load_arm(Path(sys.argv[1]))
planner = Planner(arm)
planner.prepare()
start = JointState(name=arm.joint_names, position=arm.named_states["home"])
response = planner.plan(PlanRequest(goal=NamedGoal(name="ready"), start=start, allowed_time=100.0), None)
assert response.code is PlanCode.SUCCESS, response.refusal
print(time.process_time() - began)
"""


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
