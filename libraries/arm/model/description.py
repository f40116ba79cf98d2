"""A robot's folder as one typed `ArmDescription`: URDF, SRDF and robot.toml, checked against each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import msgspec

from gemelo.libraries.arm.errors import DescriptionError, nearest, wrong_file
from gemelo.libraries.arm.model.gripper import require_gripper
from gemelo.libraries.arm.model.robot_file import read_robot_data, read_text, typed_robot
from gemelo.libraries.arm.model.srdf import SrdfModel, read_srdf
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, UrdfModel, read_urdf
from gemelo.libraries.arm.model.virtual_drive import TO_DRIVE, lacks_motors, with_virtual_drive
from gemelo.libraries.arm.motors.relative_moves import loop_of, ramp_of
from gemelo.libraries.arm.motors.speed import speed_limits
from gemelo.libraries.arm.motors.steps import StepScale, step_scale
from gemelo.libraries.toml_lines import type_mistake
from gemelo.schemas.deployment import DeviceKind
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.robot import (
    CLEARANCE,
    DeviceRecord,
    Dialect,
    DigitalOutput,
    Driver,
    Input,
    RobotFile,
    Sensor,
    StepperJoint,
    Transmission,
)

Wrong = Callable[[Reason], DescriptionError]  # the error of one joint of a file

ROBOT_FILE = "robot.toml"
DEFAULT_URDF = "robot.urdf"
ROUNDING = 1e-4  # [rad] or [m] chosen: pi in four decimals; a limit that is missed by it was rounded


@dataclass(frozen=True)
class Joint:
    """A joint that a motor moves; limits are the tighter ones of the URDF and of the motor."""

    name: str
    wire_name: str
    kind: JointKind
    unit: str  # "rad" or "m"
    lower: float  # [rad] or [m]; -inf for a continuous joint
    upper: float  # [rad] or [m]
    velocity: float  # [rad/s] or [m/s]
    acceleration: float  # [rad/s^2] or [m/s^2]
    jerk: float  # [rad/s^3] or [m/s^3]
    steps: StepScale
    drive: StepperJoint
    driver: Driver

    def clamp(self, position: float) -> float:
        """The nearest position [rad] or [m] within the limits."""
        return min(max(position, self.lower), self.upper)

    def rounded(self, position: float) -> float:
        """The limit where `position` [rad] or [m] misses it by no more than `ROUNDING`, else `position`."""
        limit = self.clamp(position)
        return limit if abs(position - limit) <= ROUNDING else position

    def is_within(self, position: float) -> bool:
        """True if `position` [rad] or [m] is within the limits."""
        return self.lower <= position <= self.upper


@dataclass(frozen=True)
class ArmDescription:
    """One robot: its joints in robot.toml's order, which is their order everywhere."""

    name: str
    folder: Path
    urdf_path: Path
    srdf_path: Path
    robot_path: Path
    base_frame: str
    tool_frame: str
    has_motors: bool  # False: to plan and look at only, and `device` is a generated virtual one
    device: DeviceRecord
    drivers: tuple[Driver, ...]
    joints: tuple[Joint, ...]
    inputs: tuple[Input, ...]
    outputs: tuple[DigitalOutput, ...]
    sensors: tuple[Sensor, ...]
    named_states: dict[str, tuple[float, ...]]  # [rad] or [m]
    partial_states: dict[str, dict[str, float]]  # of groups that have only some of the joints
    disabled_collisions: frozenset[frozenset[str]]  # pairs of links
    model: UrdfModel
    clearance: float = CLEARANCE  # [m] that plans keep between things that may not touch
    gripper: Gripper | None = None

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def reference_position(self) -> tuple[float, ...]:
        """[rad] or [m] of the pose that a person declares as the reference."""
        return tuple(joint.drive.reference_position for joint in self.joints)

    def joint(self, name: str) -> Joint:
        """The joint of that name; raises `DescriptionError` with the nearest one."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        near = nearest(name, self.joint_names)
        raise DescriptionError(because("robot.joint.unknown", near, robot=self.name, joint=name))

    @property
    def state_names(self) -> tuple[str, ...]:
        """Of all joints, and of some."""
        return (*self.named_states, *self.partial_states)

    def named_state(self, name: str, standing: Sequence[float]) -> tuple[float, ...] | None:
        """Joint values (n,) [rad] or [m] of a named state; absent joints as in `standing`. None if unknown."""
        if name in self.named_states:
            return self.named_states[name]
        values = self.partial_states.get(name)
        if values is None:
            return None
        return tuple(values.get(joint, value) for joint, value in zip(self.joint_names, standing, strict=True))

    def collisions_are_disabled(self, first: str, second: str) -> bool:
        """True if the SRDF disables the collision check of this pair of links."""
        return frozenset((first, second)) in self.disabled_collisions


def load_arm(folder: Path) -> ArmDescription:
    """The arm described in `folder`; raises `DescriptionError` with file, thing and value."""
    robot_path = Path(folder) / ROBOT_FILE
    text = read_text(robot_path)
    data = read_robot_data(robot_path, text)
    urdf_path = robot_path.with_name(str(data.get("urdf", DEFAULT_URDF)))
    model = read_urdf(urdf_path)
    bare = lacks_motors(data, robot_path)
    try:
        robot = typed_robot(with_virtual_drive(data, model) if bare else data)
    except msgspec.ValidationError as error:
        line, what = type_mistake(error, text)
        raise wrong_file(robot_path, what, line) from error
    srdf_path = robot_path.with_name(robot.srdf)
    srdf = read_srdf(srdf_path)
    _require_frames(robot, model, robot_path)
    require_gripper(robot, robot_path, text)
    drivers = {driver.name: driver for driver in robot.driver}
    joints = tuple(_joint(drive, drivers, model, robot_path) for drive in robot.joint)
    _require_joints(joints, model, robot_path)
    arm = ArmDescription(
        name=robot.name,
        folder=robot_path.parent,
        urdf_path=urdf_path,
        srdf_path=srdf_path,
        robot_path=robot_path,
        base_frame=robot.base_frame,
        tool_frame=robot.tool_frame,
        has_motors=not bare,
        device=robot.device,
        drivers=robot.driver,
        joints=joints,
        inputs=robot.input,
        outputs=robot.output,
        sensors=robot.sensor,
        named_states=_named_states(srdf, robot.group, joints, srdf_path),
        partial_states=_partial_states(srdf, robot.group, joints),
        disabled_collisions=frozenset(frozenset(pair) for pair in srdf.disabled),
        model=model,
        clearance=robot.clearance,
        gripper=robot.gripper,
    )
    return as_its_board_drives_it(arm)


def as_its_board_drives_it(arm: ArmDescription) -> ArmDescription:
    """Without what the board's dialect has no words for: switches, homing, motor current; as slow as it can follow."""
    if arm.device.dialect is Dialect.GEMELO:
        return arm
    device = msgspec.structs.replace(arm.device, enable_pin=None, armed_at_boot=True)
    joints = tuple(_driven_joint(joint, device) for joint in arm.joints)
    return replace(arm, device=device, joints=joints, inputs=())


def _driven_joint(joint: Joint, device: DeviceRecord) -> Joint:
    joint = replace(joint, drive=msgspec.structs.replace(joint.drive, homing=None))
    if device.dialect is not Dialect.RA:
        return joint
    speed = ramp_of(joint.drive).path_speed(device.message_time, loop_of(device)) / joint.steps.per_unit
    return replace(joint, velocity=min(joint.velocity, speed))


def require_motors(arm: ArmDescription, device: DeviceKind) -> None:
    """Raises `DescriptionError` for an arm without motors at a real device, with what robot.toml lacks."""
    if device is not DeviceKind.VIRTUAL and not arm.has_motors:
        what = because("robot.no_motors.device", TO_DRIVE, remedy("start_virtual"), device=str(device))
        raise wrong_file(arm.robot_path, what)


def _joint(drive: StepperJoint, drivers: dict[str, Driver], model: UrdfModel, path: Path) -> Joint:
    wrong = partial(_wrong_joint, path, drive.name)
    if drive.name not in model.joint_names:
        raise wrong(because("robot.joint.not_in_urdf", nearest(drive.name, model.joint_names)))
    if drive.motor.driver not in drivers:
        known = nearest(drive.motor.driver, drivers)
        raise wrong(because("robot.driver.none", known, driver=drive.motor.driver))
    urdf = model.joint(drive.name)
    _require_transmission(drive, urdf, wrong)
    try:
        scale, speed = step_scale(drive), speed_limits(drive)
    except DescriptionError as error:
        raise wrong_file(path, error.reason) from error
    lower, upper, velocity = _limits(urdf, drive, wrong)
    return Joint(
        name=drive.name,
        wire_name=drive.wire_name,
        kind=urdf.kind,
        unit="m" if urdf.kind is JointKind.PRISMATIC else "rad",
        lower=lower,
        upper=upper,
        velocity=min(velocity, speed.velocity),
        acceleration=speed.acceleration,
        jerk=speed.jerk,
        steps=scale,
        drive=drive,
        driver=drivers[drive.motor.driver],
    )


def _wrong_joint(path: Path, name: str, what: Reason) -> DescriptionError:
    return wrong_file(path, because("robot.joint", what, joint=name))


def _require_transmission(drive: StepperJoint, urdf: UrdfJoint, wrong: Wrong) -> None:
    """A metre is not a radian: a sliding joint has a rack, a turning one has none."""
    if urdf.mimic is not None:
        raise wrong(because("robot.joint.follows"))
    if urdf.kind is JointKind.FIXED:
        raise wrong(because("robot.joint.fixed"))
    slides = urdf.kind is JointKind.PRISMATIC
    if slides != (drive.transmission is Transmission.RACK_AND_PINION):
        needed = Transmission.RACK_AND_PINION if slides else Transmission.ROTARY
        kind, given = str(urdf.kind), str(drive.transmission)
        other = remedy("write_transmission", transmission=str(needed))
        raise wrong(because("robot.transmission", other, kind=kind, transmission=given))


def _limits(urdf: UrdfJoint, drive: StepperJoint, wrong: Wrong) -> tuple[float, float, float]:
    """Lower, upper and velocity, within the mechanics; `gemelo check` says more about limits that are odd."""
    if urdf.limit is None:
        raise wrong(because("robot.joint.no_limit"))
    if not urdf.limit.velocity > 0.0:
        raise wrong(because("robot.joint.velocity_limit", value=urdf.limit.velocity))
    if urdf.kind is JointKind.CONTINUOUS:
        return -math.inf, math.inf, urdf.limit.velocity
    lower, upper = urdf.limit.lower, urdf.limit.upper
    if drive.mechanical_lower is not None:
        lower = max(lower, drive.mechanical_lower)
    if drive.mechanical_upper is not None:
        upper = min(upper, drive.mechanical_upper)
    if not lower < upper:
        raise wrong(because("robot.joint.no_travel", lower=lower, upper=upper))
    return lower, upper, urdf.limit.velocity


def _require_frames(robot: RobotFile, model: UrdfModel, path: Path) -> None:
    for key, frame in (("base_frame", robot.base_frame), ("tool_frame", robot.tool_frame)):
        if frame not in model.link_names:
            near = nearest(frame, model.link_names)
            raise wrong_file(path, because("robot.frame.key", near, key=key, frame=frame))


def _require_joints(joints: tuple[Joint, ...], model: UrdfModel, path: Path) -> None:
    """Every moving joint has exactly one motor, and every wire name is used once."""
    if not joints:
        raise wrong_file(path, because("robot.joints.none"))
    for key, names in (("name", [j.name for j in joints]), ("wire_name", [j.wire_name for j in joints])):
        for name in names:
            if (count := names.count(name)) > 1:
                raise _wrong_joint(path, name, because("robot.joint.twice", key=key, count=count))
    driven = {joint.name for joint in joints}
    for urdf in model.joints:
        if urdf.kind is not JointKind.FIXED and urdf.mimic is None and urdf.name not in driven:
            raise _wrong_joint(path, urdf.name, because("robot.joint.no_motor", remedy("add_joint_or_fix")))


def _named_states(srdf: SrdfModel, group: str, joints: tuple[Joint, ...], path: Path) -> dict[str, tuple[float, ...]]:
    """The states of the group in the arm's joint order."""
    states: dict[str, tuple[float, ...]] = {}
    for state in srdf.states:
        if state.group != group:
            continue
        missing = tuple(joint.name for joint in joints if joint.name not in state.values)
        if missing:
            raise wrong_file(path, because("srdf.state.missing", state=state.name, joints=missing))
        states[state.name] = tuple(state.values[joint.name] for joint in joints)
    return states


def _partial_states(srdf: SrdfModel, group: str, joints: tuple[Joint, ...]) -> dict[str, dict[str, float]]:
    """The states of the other groups whose joints are all driven, by names that the arm's own group does not have."""
    names = {joint.name for joint in joints}
    own = {state.name for state in srdf.states if state.group == group}
    return {
        state.name: state.values
        for state in srdf.states
        if state.group != group and state.name not in own and state.values and names >= set(state.values)
    }
