"""The plug-in of LeRobot on a stand-in for LeRobot, and the twins that it finds."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from tests.simulated import found_by_connect, make_ready

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "integrations/lerobot_robot_gemelo"
STUB = Path(__file__).parent / "stub"
CELL = ROOT / "urdf/rm1/cell.toml"


@pytest.fixture(scope="module")
def plugin() -> Iterator[ModuleType]:
    """As LeRobot imports it; neither it nor the stand-in stays loaded."""
    loaded = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(STUB)
        patch.syspath_prepend(PLUGIN)
        yield importlib.import_module("lerobot_robot_gemelo")
        for name in set(sys.modules) - loaded:
            if name.partition(".")[0] in ("lerobot", "lerobot_robot_gemelo"):
                del sys.modules[name]


@pytest.fixture(scope="module")
def simulated() -> Iterator[SimulatedArm]:
    """What the plug-in connects to."""
    with gemelo.simulate("rm1") as arm, found_by_connect(arm):
        yield arm


@pytest.fixture
def arm(simulated: SimulatedArm) -> SimulatedArm:
    """Referenced, armed and at rest in the state home, with an empty scene; no stream is under way."""
    make_ready(simulated)
    simulated.move(named="home")
    simulated.sim.sleep(0.6)
    return simulated


@pytest.fixture
def options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Of every configuration in these tests, whatever was started in this folder."""
    monkeypatch.setenv("GEMELO_CONFIG", str(ROOT / "deploy/local.toml"))
    return {"arm": "rm1", "id": "mine", "calibration_dir": tmp_path}


@pytest.fixture
def make(plugin: ModuleType, options: dict[str, Any]) -> Iterator[Callable[..., Any]]:
    """A robot with these options; it is disconnected at the end."""
    made: list[Any] = []

    def make(**others: Any) -> Any:
        made.append(plugin.Gemelo(plugin.GemeloConfig(**options, **others)))
        return made[-1]

    yield make
    for robot in made:
        robot.disconnect()
