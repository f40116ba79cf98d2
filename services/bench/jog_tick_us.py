"""How long one step of jogging takes, of the 20 ms that it has: tool twists among obstacles and limits."""

from __future__ import annotations

import time

import numpy as np

from schemas.frames import Transform
from schemas.joints import JointState
from schemas.planning import JogCommand
from schemas.scene import BoxShape, PlanningScene, SceneObject
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, Goal, of_samples, quantile
from services.bench.postures import BOXES
from services.planner.jog.jog import PERIOD, Jog
from services.planner.scene.world import World

UNIT = "us"
COMMANDS, STEPS = 40, 25  # each command is held for half a second
SPEED = 0.15  # [m/s]
GOAL = Goal(p99=PERIOD * 1e6)  # a step that is late slows the arm


def measure() -> Figure:
    """parol6 in the scene of the other checks; the references are of the same commands in the same run."""
    reference = {
        "parol6, no scene": quantile(ticks(parol6(), PlanningScene()), 0.5),
        "rm1, same scene": quantile(ticks(rm1(), scene()), 0.5),
    }
    note = f"parol6, {len(BOXES)} boxes, {COMMANDS} random twists of up to {SPEED:g} m/s, {STEPS} steps each"
    return of_samples(ticks(parol6(), scene()), UNIT, GOAL, reference, note)


def scene() -> PlanningScene:
    """The boxes that the other checks have too."""
    return PlanningScene(
        objects=tuple(
            SceneObject(name=name, shape=BoxShape(size=size), pose=Transform(translation=place))
            for name, size, place in BOXES
        )
    )


def ticks(arm: Arm, surroundings: PlanningScene) -> list[float]:
    """[us] of every step; the arm follows at once."""
    kinematics = Kinematics(arm)
    jog = Jog(arm, kinematics, World(arm, kinematics, surroundings))
    rng = np.random.default_rng(1)
    state = JointState(name=arm.joint_names, position=arm.named_states["ready"])
    samples: list[float] = []
    for index in range(COMMANDS * STEPS):
        if index % STEPS == 0:
            command = JogCommand(linear=tuple(rng.uniform(-SPEED, SPEED, 3).tolist()))
        jog.on_command(command, index * PERIOD)
        started = time.perf_counter()
        jog.step(index * PERIOD, 0, state, 0.0, goal_is_active=False)
        samples.append((time.perf_counter() - started) * 1e6)
        if jog.commanded is not None:
            state = JointState(name=arm.joint_names, position=tuple(jog.commanded[0].tolist()))
    return samples
