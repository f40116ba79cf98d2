"""The kinds of [gripper] that robot.toml can have: a row for each, whose file stands beside this one."""

from __future__ import annotations

from gemelo.schemas.grippers.output import OutputGripper
from gemelo.schemas.grippers.servo import ServoGripper

Gripper = (
    OutputGripper
    | ServoGripper
)  # fmt: skip
