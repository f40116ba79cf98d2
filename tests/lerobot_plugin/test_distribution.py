"""The plug-in as a distribution: the name by which LeRobot finds it, and what it needs."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib

from tests.lerobot_plugin.conftest import PLUGIN

METADATA = "import sys; from setuptools import build_meta; build_meta.prepare_metadata_for_build_wheel(sys.argv[1])"


def test_lerobot_finds_the_distribution_by_its_name_with_underscores(tmp_path):
    """It compares the Name of the metadata with the prefix: lerobot-robot-gemelo would never be imported."""
    source = tmp_path / "source"
    shutil.copytree(PLUGIN, source, ignore=shutil.ignore_patterns("*.egg-info", "build", "__pycache__"))
    subprocess.run([sys.executable, "-c", METADATA, tmp_path], cwd=source, capture_output=True, check=True, timeout=60)
    text = next(tmp_path.glob("*.dist-info/METADATA")).read_text()
    name = next(line for line in text.splitlines() if line.startswith("Name: ")).removeprefix("Name: ")
    assert name.startswith("lerobot_robot_")
    assert (PLUGIN / name / "__init__.py").is_file()  # what LeRobot imports


def test_it_needs_a_client_and_numpy_alone():
    """LeRobot pins half of Python: whatever else was asked for would keep it from being installed."""
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text())["project"]
    assert project["dependencies"] == ["gemelo", "numpy>=2"]


def test_only_what_both_versions_of_lerobot_have_is_imported():
    """RobotAction and RobotObservation stand elsewhere from one version to the next."""
    lines = [line.strip() for file in (PLUGIN / PLUGIN.name).glob("*.py") for line in file.read_text().splitlines()]
    imported = {line for line in lines if "lerobot" in line and line.startswith(("from lerobot.", "import lerobot"))}
    assert imported == {
        "from lerobot.cameras import CameraConfig",
        "from lerobot.cameras import make_cameras_from_configs",
        "from lerobot.robots import Robot",
        "from lerobot.robots import RobotConfig",
        "from lerobot.teleoperators import Teleoperator",
        "from lerobot.teleoperators import TeleoperatorConfig",
    }
