"""LeRobot's loop with the plug-in on a running stack with a camera: how often it turns, and how late the arm follows.

The plug-in runs in this process on the stand-in for LeRobot's base classes that its tests have, and the loop is that
of LeRobot: an observation, an action, the rest of the period.
"""

from __future__ import annotations

import importlib
import os
import statistics
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.leaders import Signal, feasible_sine
from gemelo.tools.bench.stack import Running
from gemelo.tools.bench.stream_live import FAST, followed, speed
from gemelo.tools.stack.stack import Stack

ROOT = project_root()
CELL = ROOT / "urdf/rm1/cell.toml"
PATHS = (ROOT / "tests/lerobot_plugin/stub", ROOT / "integrations/lerobot_robot_gemelo")
LOOP_GOAL = FigureGoal(least=29.0)  # [Hz] of 30
LAG_GOAL = FigureGoal(median=60.0)  # [ms] as that of targets that are streamed alone
RATE = 30.0  # [Hz]
SECONDS, SETTLED = 12.0, 2.0  # [s] of the loop, and what of it is not measured
SINE = 0.4  # [Hz]


class Looped(NamedTuple):
    """One run of the loop."""

    rates: list[float]  # [Hz] of every second
    lags: list[float]  # [ms] of every state in fast motion
    alone: list[float]  # [ms] the same of targets that are streamed without LeRobot's loop, in the same run
    costs: tuple[float, float]  # [ms] median of an observation and of an action


def lerobot_loop_hz() -> Figure:
    """Turns a second [Hz] of a loop that is to have 30, with the virtual camera and the gripper."""
    looped = run()
    observing, acting = looped.costs
    reference = {"observation_ms": rounded(observing), "action_ms": rounded(acting)}
    return of_samples(looped.rates, LOOP_GOAL, reference, "of 30; rm1 with the camera of its cell, 5 images a second")


def lerobot_lag_ms() -> Figure:
    """Lag [ms] of the first joint behind the actions of a sine, by the stamps of the device's states."""
    looped = run()
    reference = {"arm.stream alone": rounded(quantile(looped.alone, 0.5))}
    return of_samples(
        looped.lags, LAG_GOAL, reference, f"a sine of {SINE} Hz at 0.7 of the limits, 30 actions a second"
    )


@cache
def run() -> Looped:
    """Both figures are of the same run; raises NotMeasured where no state comes."""
    with Stack(environment={"GEMELO_CELL": str(CELL)}) as stack, tempfile.TemporaryDirectory() as folder:
        deployment = load_deployment(None, stack.environment)
        arm = load_arm(ROOT / deployment.robot)
        with (
            Node("bench", deployment, robot=arm.name) as node,
            mock.patch.dict(os.environ, stack.deployment),
            mock.patch.object(sys, "path", [*map(str, PATHS), *sys.path]),
        ):
            plugin = importlib.import_module("lerobot_robot_gemelo")
            config = plugin.GemeloConfig(arm=arm.name, id="bench", calibration_dir=Path(folder), use_degrees=False)
            signal = feasible_sine(arm.joints[0], SINE)
            with plugin.Gemelo(config) as robot:
                rates, lags, costs = _looped(node, robot, arm.joints[0].name, signal)
            alone = followed(Running(stack, deployment, arm, node), signal, RATE)
    return Looped(rates, lags, alone, costs)


def _looped(node: Node, robot: Any, joint: str, signal: Signal) -> tuple[list[float], list[float], tuple[float, float]]:
    """The rates [Hz] of every second, lags [ms], and the cost [ms] of both calls."""
    states: list[JointState] = []
    node.subscribe(JOINT_STATES, states.append)
    base = robot.get_observation()
    began, start = time.monotonic(), node.now()
    turns: list[float] = []
    observing: list[float] = []
    acting: list[float] = []
    while (elapsed := time.monotonic() - began) < SECONDS:
        turns.append(elapsed)
        at = time.perf_counter()
        robot.get_observation()
        observed = time.perf_counter()
        place = base[f"{joint}.pos"] + signal((node.now() - start) * 1e-9)
        robot.send_action({**_of_arm(base), f"{joint}.pos": place})
        acting.append(1e3 * (time.perf_counter() - observed))
        observing.append(1e3 * (observed - at))
        node.wait(max(0.0, 1.0 / RATE - (time.perf_counter() - at)))
    rates = [float(sum(second <= turn < second + 1.0 for turn in turns)) for second in range(1, int(SECONDS) - 1)]
    fastest = max(abs(speed(signal, 0.02 * index)) for index in range(round(SECONDS / 0.02)))
    lags = []
    for state in states:
        t = (state.stamp - start) * 1e-9
        if SETTLED < t < SECONDS and abs(speed(signal, t)) > FAST * fastest:
            is_at = dict(zip(state.name, state.position, strict=True))[joint]
            lags.append(1e3 * (base[f"{joint}.pos"] + signal(t) - is_at) / speed(signal, t))
    if not lags:
        raise NotMeasured("no state came while the arm was in motion")
    return rates, lags, (statistics.median(observing), statistics.median(acting))


def _of_arm(observation: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in observation.items() if name.endswith(".pos")}
