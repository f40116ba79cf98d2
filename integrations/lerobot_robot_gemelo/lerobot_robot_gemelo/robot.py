"""An arm of gemelo as a robot of LeRobot."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from lerobot.cameras import make_cameras_from_configs
from lerobot.robots import Robot

import gemelo
from gemelo.libraries.lerobot.values import ArmValues, WrongValue
from gemelo.schemas.reasons import Reason, because, remedy

from .cell_cameras import CellCamera, described
from .config_gemelo import GemeloConfig
from .following import PAUSE, Follower, log
from .gripper import GripperThread
from .readings import Readings

AT_REST = 1e-3  # [rad/s] or [m/s]
TO_REST = 3.0  # [s] that the arm may take after a stop
CALIBRATE = remedy("lerobot_calibrate")


class Gemelo(Robot):  # type: ignore[misc]  # LeRobot has no types for who does not have it
    """One arm with its gripper and the cameras of its cell; it moves within its limits, and brakes when actions end."""

    config_class = GemeloConfig
    name = "gemelo"

    def __init__(self, config: GemeloConfig) -> None:
        """Reads the files of the arm and its cell; raises `gemelo.Error` for what is wrong in them, or in `config`."""
        super().__init__(config)
        self.config = config
        self._description, records = described(config.arm)
        self._values = ArmValues(self._description, use_degrees=config.use_degrees, gripper=config.gripper)
        most = config.max_relative_target
        self._most = {} if most is None else self._values.lengths("max_relative_target", most)
        self._far = self._values.lengths("far", config.far)
        known = [record.name for record in records]
        wanted = known if config.cell_cameras is None else config.cell_cameras
        if unknown := sorted(set(wanted) - set(known)):
            code = "lerobot.camera.unknown" if known else "lerobot.camera.none"
            names = {"names": tuple(known)} if known else {}
            raise WrongValue(because(code, camera=unknown[0], **names))
        if twice := sorted(set(wanted) & set(config.cameras)):
            raise WrongValue(because("lerobot.camera.twice", camera=twice[0]))
        self._cell_cameras = [CellCamera(record) for record in records if record.name in wanted]
        self._own_cameras = make_cameras_from_configs(config.cameras)
        self.cameras = {**{each.name: each for each in self._cell_cameras}, **self._own_cameras}
        self._arm: gemelo.Arm | None = None
        self._readings: Readings | None = None
        self._hold: gemelo.Hold | None = None
        self._follower: Follower | None = None
        self._gripper: GripperThread | None = None

    @cached_property
    def action_features(self) -> dict[str, Any]:
        """`<joint>.pos` [deg] or [mm], `gripper.pos` 0 closed to 100 open; known without a connection."""
        return dict(self._values.features)

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """The same, and by the name of each camera the shape (height, width, 3) of its images."""
        return {
            **self._values.features,
            **{name: (each.height, each.width, 3) for name, each in self.cameras.items()},
        }

    @property
    def is_connected(self) -> bool:
        """True between `connect` and `disconnect`."""
        return self._arm is not None

    @property
    def is_calibrated(self) -> bool:
        """True if every joint knows where it stands: it is home, or was declared."""
        return self._arm is not None and all(self._arm.device.state.referenced)

    def connect(self, calibrate: bool = True) -> None:
        """Takes control, and awaits images; never moves the arm, and never homes it, whatever `calibrate` says.

        Raises `gemelo.Error` with the remedy, also where a joint does not know where it stands; not so without
        `calibrate`, as for `lerobot-calibrate`.
        """
        if self._arm is not None:
            raise ConnectionError(str(because("lerobot.connected", name=str(self))))
        self._arm = gemelo.connect(self.config.arm, timeout=self.config.timeout)
        try:
            self._require_same_arm(self._arm)
            self._readings = Readings(self._arm)
            if self._values.gripper is not None and not self._arm.gripper.known:
                raise _refused(because("lerobot.gripper"))
            if not self.config.external_commands:
                self._prepare(self._arm, self._readings, calibrate)
            for cell_camera in self._cell_cameras:
                cell_camera.connect_to(self._arm, self.config.timeout)
            for own_camera in self._own_cameras.values():
                own_camera.connect()
        except BaseException:
            self.disconnect()
            raise

    def configure(self) -> None:
        """Nothing: an arm's parameters are those of robot.toml."""

    def calibrate(self) -> None:
        """Homes every joint that has a switch; raises `gemelo.Error`."""
        self._connected().home()

    def get_observation(self) -> dict[str, Any]:
        """Where the joints and the gripper are, and each camera's newest image (height, width, 3)."""
        self._connected()
        readings = self._readings
        assert readings is not None  # since the connection
        found: dict[str, Any] = dict(self._values.positions(readings.joints))
        if self._values.gripper is not None:
            found |= self._values.opening(readings.opening)
        return found | {name: camera.read_latest() for name, camera in self.cameras.items()}

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Sends the action, clipped and bounded, and returns what was sent; `action` itself becomes that.

        LeRobot records the dictionary that it has sent, not the one that is returned. Raises `gemelo.Error` where the
        arm does not move any more: that ends LeRobot's loop.
        """
        self._connected()
        if self._follower is None:  # external commands
            return action
        sent = self._values.positions(self._follower.follow(self._values.targets(action)))
        opening = self._values.gripper_target(action)
        if self._gripper is not None and opening is not None:
            sent |= self._values.opening(self._gripper.want(opening))
        action.update(sent)
        return sent

    def disconnect(self) -> None:
        """Stops an arm that follows, awaits its rest, gives control back; may be called twice."""
        arm, self._arm = self._arm, None
        if arm is None:
            return
        follower, self._follower = self._follower, None
        gripper, self._gripper = self._gripper, None
        hold, self._hold = self._hold, None
        with contextlib.ExitStack() as closing:  # in reverse, each whatever becomes of the others
            closing.callback(arm.close)
            if hold is not None:
                closing.callback(_whatever, hold.give)
            for camera in self.cameras.values():
                closing.callback(_whatever, camera.disconnect)
            if gripper is not None:
                closing.callback(_whatever, gripper.close)
            if follower is not None:
                closing.callback(_whatever, lambda: _rest(arm, follower))

    def _connected(self) -> gemelo.Arm:
        if self._arm is None:
            raise ConnectionError(str(because("lerobot.not_connected", name=str(self))))
        return self._arm

    def _require_same_arm(self, arm: gemelo.Arm) -> None:
        """The features were made from files; raises `gemelo.Error` where another arm runs."""
        if arm.joint_names != self._description.joint_names:
            raise gemelo.Error(because("lerobot.other_arm", running=arm.name, robot=self._description.name))

    def _prepare(self, arm: gemelo.Arm, readings: Readings, needs_reference: bool) -> None:
        config = self.config
        self._follower = Follower(
            arm, readings, most=self._most, far=self._far, plan_first=config.plan_first, guard=config.guard
        )
        require_ready(arm, needs_reference)
        if config.take_control:
            self._hold = arm.take_control("lerobot")
        arm.wait_for(lambda: False, PAUSE)  # a stream that somebody has just ended refuses targets until then
        if self._values.gripper is not None:
            self._gripper = GripperThread(arm)


def require_ready(arm: gemelo.Arm, needs_reference: bool) -> None:
    """Raises `gemelo.Refused` where the arm cannot follow: a fault, no current, a held path, unknown joints."""
    state = arm.device.state
    device = arm.description.device.name
    if arm.device.fault:
        raise gemelo.Refused(arm.device.fault, check="device")
    if not needs_reference:
        return
    if not state.armed:
        raise _refused(because("device.disarmed", CALIBRATE, device=device))
    if state.mode is gemelo.DeviceMode.HOLD:
        raise _refused(because("lerobot.held"))
    lost = tuple(name for name, known in zip(arm.joint_names, state.referenced, strict=True) if not known)
    if lost:
        raise _refused(because("device.unreferenced", CALIBRATE, device=device, joints=lost))


def _refused(why: Reason) -> gemelo.Refused:
    return gemelo.Refused(because("client.refused", why), check="device", reason=why)


def _rest(arm: gemelo.Arm, follower: Follower) -> None:
    if follower.rate:
        log.info("%.1f actions a second were sent: a dataset's times count what it was recorded with", follower.rate)
    if not follower.is_streaming:
        return
    arm.stop()
    if not arm.wait_for(lambda: is_at_rest(arm.velocities), TO_REST):
        log.warning("the arm is not at rest %.0f s after the stop", TO_REST)


def is_at_rest(velocities: Mapping[str, float]) -> bool:
    """True if no joint moves, by its velocity [rad/s] or [m/s]."""
    return all(abs(speed) < AT_REST for speed in velocities.values())


def _whatever(do: Any) -> None:
    """What fails at the end must not hide why it ended."""
    try:
        do()
    except Exception as error:
        log.warning("while disconnecting: %s", error)
