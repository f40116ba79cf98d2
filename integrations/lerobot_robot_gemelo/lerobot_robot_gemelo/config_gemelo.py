"""The options of the robot and of the teleoperator, as `--robot.NAME` and `--teleop.NAME` of LeRobot's commands."""

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@RobotConfig.register_subclass("gemelo")
@dataclass(kw_only=True)
class GemeloConfig(RobotConfig):  # type: ignore[misc]  # LeRobot has no types for who does not have it
    """An arm of gemelo, whose class LeRobot finds by this name without "Config"."""

    arm: str = ""  # as gemelo.connect takes it: a name, a folder, or an address such as tcp/lab:7447
    timeout: float = 5.0  # [s] that the twin, and the first image of each camera, may take
    use_degrees: bool = True  # degrees and millimetres; False: radians and metres
    take_control: bool = True  # nobody else moves the arm meanwhile
    external_commands: bool = False  # something else moves the arm (a page, a program): actions are recorded, not sent
    max_relative_target: float | dict[str, float] | None = 10.0  # from where a joint is, in the unit of its feature
    far: float = 5.0  # from this on, in the same unit, the first target is gone to by a plan
    plan_first: bool = True  # False: a first target that is far is refused
    # The gateway watches streams, and stops the arm clear of what is in the way. True: each target is checked here too,
    # and not sent where the arm may not stand: 3 ms an action, for a device whose streams cannot be watched.
    guard: bool = False
    gripper: bool = True  # False: the arm's gripper is no part of observations and actions
    cell_cameras: list[str] | None = None  # of the cell's cameras these; None: all
    cameras: dict[str, CameraConfig] = field(default_factory=dict)  # LeRobot's own, beside them


@TeleoperatorConfig.register_subclass("gemelo")
@dataclass(kw_only=True)
class GemeloTeleopConfig(TeleoperatorConfig):  # type: ignore[misc]
    """What moves an arm of gemelo, as actions."""

    arm: str = ""  # as GemeloConfig.arm
    timeout: float = 5.0  # [s] that the twin may take
    use_degrees: bool = True
    gripper: bool = True
