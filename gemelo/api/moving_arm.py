"""The part of an `Arm` that procedures of several motions need, such as a pick or a verification."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, Unpack

from gemelo.api.arguments import Grip, Joints, Target, ToolGoal
from gemelo.api.device import Device
from gemelo.api.gripping import Gripped
from gemelo.api.homing_report import HomingReport
from gemelo.api.ledger import Ledger
from gemelo.api.motion import Motion, OnMotion
from gemelo.api.planning import Configurations, Plan
from gemelo.api.scene import Scene
from gemelo.api.units import Pose
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node


class MovingArm(Protocol):
    """As of `Arm`."""

    @property
    def name(self) -> str: ...

    @property
    def node(self) -> Node: ...

    @property
    def description(self) -> ArmDescription: ...

    @property
    def joint_names(self) -> tuple[str, ...]: ...

    @property
    def joints(self) -> Mapping[str, float]: ...

    @property
    def ledger(self) -> Ledger: ...

    @property
    def device(self) -> Device: ...

    @property
    def scene(self) -> Scene: ...

    def plan(self, **target: Unpack[Target]) -> Plan: ...

    def execute(self, plan: Plan, *, on_progress: OnMotion | None = ...) -> Motion: ...

    def home(self, *joints: str) -> HomingReport: ...

    def grip(self, to: Grip, *, is_cancelled: Callable[[], bool] | None = ...) -> Gripped: ...

    def ik(self, *, solutions: int = ..., **goal: Unpack[ToolGoal]) -> Configurations: ...

    def fk(self, joints: Joints | None = ...) -> Pose: ...
