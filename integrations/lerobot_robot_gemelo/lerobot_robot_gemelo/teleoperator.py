"""Actions of a person or a program with an arm of gemelo: to record them, or to lead another robot by them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from lerobot.teleoperators import Teleoperator

import gemelo
from gemelo.libraries.lerobot.values import ArmValues
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import because

from .cell_cameras import described
from .config_gemelo import GemeloTeleopConfig
from .readings import Readings

NEW = 0.2  # [s] for which a streamed target is what is wanted; after it, what the path asks for


class GemeloTeleop(Teleoperator):  # type: ignore[misc]  # LeRobot has no types for who does not have it
    """The newest streamed or jogged target of each joint; while there is none, what the planned path asks for.

    The page, `gemelo jog`, a leader arm, a program and `gemelo move` all move the arm by one of the two.
    """

    config_class = GemeloTeleopConfig
    name = "gemelo"

    def __init__(self, config: GemeloTeleopConfig) -> None:
        """Reads the files of the arm; raises `gemelo.Error` for what is wrong in them."""
        super().__init__(config)
        self.config = config
        description, _ = described(config.arm)
        self._values = ArmValues(description, use_degrees=config.use_degrees, gripper=config.gripper)
        self._arm: gemelo.Arm | None = None
        self._streamed: dict[str, float] = {}  # [rad] or [m] by joint
        self._streamed_at: dict[str, float] = {}  # [s] monotonic, by joint

    @cached_property
    def action_features(self) -> dict[str, Any]:
        """As those of the robot: `<joint>.pos` and `gripper.pos`."""
        return dict(self._values.features)

    @cached_property
    def feedback_features(self) -> dict[str, Any]:
        """None: a page cannot be pushed back."""
        return {}

    @property
    def is_connected(self) -> bool:
        """True between `connect` and `disconnect`."""
        return self._arm is not None

    @property
    def is_calibrated(self) -> bool:
        """Always: nothing of it is calibrated."""
        return True

    def connect(self, calibrate: bool = True) -> None:
        """Listens; takes no control and moves nothing. Raises `gemelo.Error`."""
        if self._arm is not None:
            raise ConnectionError(str(because("lerobot.connected", name=str(self))))
        self._arm = gemelo.connect(self.config.arm, timeout=self.config.timeout)
        self._readings = Readings(self._arm)
        self._arm.node.subscribe(gemelo.topics.JOINT_TARGETS, self._on_targets)
        self._commands = self._arm.node.latest(gemelo.topics.JOINT_COMMANDS)

    def calibrate(self) -> None:
        """Nothing."""

    def configure(self) -> None:
        """Nothing."""

    def get_action(self) -> dict[str, float]:
        """What each joint is to do now, and the gripper's target."""
        if self._arm is None:
            raise ConnectionError(str(because("lerobot.not_connected", name=str(self))))
        wanted = self._readings.joints
        if (path := self._commands.message) is not None and not self._commands.is_stale:
            wanted |= dict(zip(path.name, path.position, strict=True))
        now = self._arm.node.monotonic()
        wanted |= {name: self._streamed[name] for name, at in self._streamed_at.items() if now - at < NEW}
        found = self._values.positions(wanted)
        if self._values.gripper is not None:
            found |= self._values.opening(self._readings.opening_wanted)
        return found

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Nothing."""

    def disconnect(self) -> None:
        """Listens no more; may be called twice."""
        arm, self._arm = self._arm, None
        if arm is not None:
            arm.close()

    def _on_targets(self, message: JointTargets) -> None:
        if self._arm is not None:
            now = self._arm.node.monotonic()
            self._streamed |= dict(zip(message.name, message.position, strict=True))
            self._streamed_at |= dict.fromkeys(message.name, now)
