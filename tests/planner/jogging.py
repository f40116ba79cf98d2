"""A jog with the gateway's own tracker behind it, in virtual time."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, JogStatus
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog import PERIOD, Jog
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
BOXES = {
    "rm1": (("post", (0.06, 0.06, 0.5), (0.40, 0.22, 0.25)), ("lid", (0.3, 0.3, 0.02), (0.0, 0.5, 0.1))),
    "parol6": (("post", (0.06, 0.06, 0.5), (0.13, 0.20, 0.25)), ("table", (0.5, 0.5, 0.02), (0.35, 0.0, 0.02))),
}


@cache
def arm_of(name: str) -> ArmDescription:
    return load_arm(ROOT / "urdf" / name)


@cache
def kinematics_of(name: str) -> Kinematics:
    return Kinematics(arm_of(name))


@cache
def world_of(name: str, crowded: bool = True) -> World:
    """The arm between a few boxes, or alone."""
    boxes = tuple(
        SceneObject(name=box, shape=BoxShape(size=size), pose=Transform(translation=place))
        for box, size, place in (BOXES[name] if crowded else ())
    )
    return World(arm_of(name), kinematics_of(name), PlanningScene(objects=boxes))


class Jogged:
    """What was commanded, what the tracker made of it, and what was said, one row a period."""

    def __init__(self, name: str, start: str = "ready", crowded: bool = True) -> None:
        self.arm, self.kinematics, self.world = arm_of(name), kinematics_of(name), world_of(name, crowded)
        self.jog = Jog(self.arm, self.kinematics, self.world)
        self.tracker = TargetTracker(Limits.of(self.arm.joints), PERIOD, Knot.at_rest(self.arm.named_states[start]))
        self.now = 0.0
        self.goal_is_active = False
        self.commanded: list[Array] = []
        self.velocities: list[Array] = []
        self.knots: list[Knot] = []
        self.statuses: list[JogStatus] = []
        self.said: list[str] = []

    @property
    def state(self) -> JointState:
        knot = self.tracker.knot
        return JointState(name=self.arm.joint_names, position=knot.position, velocity=knot.velocity)

    def tick(self, command: JogCommand | None = None) -> None:
        """One period, with or without a command."""
        if command is not None:
            self.jog.on_command(command, self.now)
        output = self.jog.step(self.now, round(self.now * 1e9), self.state, 0.0, self.goal_is_active)
        if output.targets is not None:
            self.tracker.follow(output.targets.position)
        if output.status is not None:
            self.statuses.append(output.status)
        if output.said:
            self.said.append(output.said)
        if self.jog.commanded is not None:
            self.commanded.append(self.jog.commanded[0])
            self.velocities.append(self.jog.commanded[1])
        self.knots.append(self.tracker.step())
        self.now += PERIOD

    def hold(self, command: JogCommand | None, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.tick(command)

    def let_go(self, seconds: float = 6.0) -> None:
        """Say nothing until the jog has ended."""
        end = self.now + seconds
        while self.jog.is_busy and self.now < end:
            self.tick()
        assert not self.jog.is_busy

    def abandoned(self) -> list[Knot]:
        """Where the arm would go if the targets ceased now."""
        knot = self.tracker.knot
        alone = TargetTracker(Limits.of(self.arm.joints), PERIOD, knot)
        alone.follow(self.tracker.target)
        knots = [alone.step() for _ in range(200)]
        assert knots[-1].is_at_rest
        return knots

    def limits(self) -> str:
        """All that was said to limit the jog."""
        return " ".join(status.limited_by for status in self.statuses)
