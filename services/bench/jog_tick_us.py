"""What one step of jogging costs of the 20 ms that it has, in CPU time: tool twists among obstacles and limits."""

from __future__ import annotations

import time

import numpy as np

from schemas.joints import JointState
from schemas.planning import JogCommand
from schemas.scene import PlanningScene
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, Goal, of_samples, quantile
from services.bench.postures import SCENE
from services.planner.collision.world import World
from services.planner.jog.jog import PERIOD, Jog

UNIT = "us"
COMMANDS, STEPS = 40, 25  # each command is held for half a second
SPEED = 0.15  # [m/s]
GOAL = Goal(p99=0.25 * PERIOD * 1e6)  # a step that is late slows the arm, and other processes want the core too


def measure() -> Figure:
    """parol6 in the scene of the other checks; the references are of the same commands in the same run."""
    reference = {
        "parol6, no scene": quantile(ticks(parol6(), PlanningScene()), 0.5),
        "rm1, same scene": quantile(ticks(rm1(), SCENE), 0.5),
    }
    note = (
        f"parol6, {len(SCENE.objects)} boxes, {COMMANDS} random twists of up to {SPEED:g} m/s, {STEPS} steps each, "
        "CPU time"
    )
    return of_samples(ticks(parol6(), SCENE), UNIT, GOAL, reference, note)


def ticks(arm: Arm, checker: PlanningScene) -> list[float]:
    """[us] of every step; the arm follows at once."""
    kinematics = Kinematics(arm)
    jog = Jog(arm, kinematics, World(arm, kinematics, checker))
    rng = np.random.default_rng(1)
    state = JointState(name=arm.joint_names, position=arm.named_states["ready"])
    samples: list[float] = []
    for index in range(COMMANDS * STEPS):
        if index % STEPS == 0:
            command = JogCommand(linear=tuple(rng.uniform(-SPEED, SPEED, 3).tolist()))
        jog.on_command(command, index * PERIOD)
        started = time.thread_time()
        jog.step(index * PERIOD, 0, state, 0.0, goal_is_active=False)
        samples.append((time.thread_time() - started) * 1e6)
        if jog.commanded is not None:
            state = JointState(name=arm.joint_names, position=tuple(jog.commanded[0].tolist()))
    return samples
