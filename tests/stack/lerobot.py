"""LeRobot's own commands with the plug-in, on a whole stack with the virtual camera; deploy/try_lerobot runs it."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import gemelo
from gemelo.tools.stack.stack import Stack

ROOT = Path(__file__).parents[2]
CELL = ROOT / "urdf/rm1/cell.toml"
LONGEST = 240.0  # [s] of one command
ROBOT = ("--robot.type=gemelo", "--robot.arm=rm1", "--robot.id=mine")
TELEOP = ("--teleop.type=gemelo", "--teleop.arm=rm1", "--teleop.id=hand")
LOAD = """
import sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
data = LeRobotDataset("me/cups", root=sys.argv[1], video_backend="pyav")  # torchcodec needs the system's FFmpeg
print("loaded", data.meta.total_episodes, "episodes,", len(data), "frames,", sorted(data[len(data) - 1]))
moved = [float(data[index]["action"][0]) for index in range(0, len(data), 5)]
assert max(moved) - min(moved) > 10.0, moved
"""


def run(folder: Path, environment: dict[str, str], *command: str) -> str:
    """What a command of LeRobot prints; ends this program where it fails."""
    began = time.monotonic()
    done = subprocess.run(
        [folder / "bin" / command[0], *command[1:]],
        env=environment, capture_output=True, text=True, timeout=LONGEST, check=False,
    )  # fmt: skip
    said = done.stdout + done.stderr
    print(f"{command[0]}: exit code {done.returncode}, {time.monotonic() - began:.0f} s", flush=True)
    if done.returncode:
        sys.exit("\n".join(said.splitlines()[-30:]))
    for line in said.splitlines():
        if "actions a second" in line or line.startswith("loaded"):
            print("   ", line.partition("INFO ")[2] or line, flush=True)
    return said


def move(robot: gemelo.Robot, ended: threading.Event) -> None:
    """A person who demonstrates: to and fro, with the gripper."""
    with gemelo.connect(robot, name="person") as arm:
        while not ended.is_set():
            for target, jaws in ((0.5, 0.02), (-0.5, 0.045)):
                with contextlib.suppress(gemelo.Aborted, gemelo.Refused):  # while videos take all cores
                    arm.move(joints={"brazo_joint": target})
                    arm.grip(jaws)


def main(folder: Path) -> None:
    """Raises `SystemExit` with the end of its output where a command fails."""
    work = Path(tempfile.mkdtemp(prefix="gemelo-lerobot-"))
    with Stack(environment={"GEMELO_CELL": str(CELL)}) as stack:
        environment = {**stack.environment, "HF_LEROBOT_HOME": str(work / "home"), "HF_HUB_OFFLINE": "1"}
        os.environ.update(stack.deployment)
        robot = gemelo.load_robot("rm1")
        data = ("--dataset.repo_id=me/cups", f"--dataset.root={work / 'cups'}")
        run(folder, environment, "lerobot-calibrate", *ROBOT)
        run(folder, environment, "lerobot-teleoperate", *ROBOT, *TELEOP, "--fps=30", "--teleop_time_s=5")
        ended = threading.Event()
        person = threading.Thread(target=move, args=(robot, ended))
        person.start()
        try:
            run(
                folder, environment, "lerobot-record", *ROBOT, "--robot.external_commands=true", *TELEOP, *data,
                "--dataset.single_task=to and fro", "--dataset.fps=30", "--dataset.num_episodes=2",
                "--dataset.episode_time_s=5", "--dataset.reset_time_s=1", "--dataset.push_to_hub=false",
                "--play_sounds=false",
            )  # fmt: skip
        finally:
            ended.set()
            person.join(60.0)
        run(folder, environment, "lerobot-replay", *ROBOT, *data, "--dataset.episode=0", "--play_sounds=false")
        run(folder, environment, "python", "-c", LOAD, str(work / "cups"))
        with gemelo.connect(robot, name="afterwards") as arm:
            assert not arm.control.held, arm.control.holder
            errors = {name: round(error, 2) for name, error in arm.step_errors.items()}
            print("step errors at the end:", errors, flush=True)
            assert max(map(abs, errors.values())) <= 0.5
    print("all of LeRobot's commands worked")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
