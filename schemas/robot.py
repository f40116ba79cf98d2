"""`urdf/<robot>/robot.toml` as types: what turns steps into motion. Read by `gemelo.libraries.arm`.

Numbers that must be exact (gear ratios) are TOML strings holding a fraction or a decimal, for
example "46.656" or "380/21"; everything else is SI unless the name says otherwise. Bounds stand with the types;
those that depend on another field or file are checked by `gemelo.libraries.arm`.

An arm to plan and look at only leaves out [device], [[driver]], every [joint.motor] and whatever is wired to a pin, and
[[joint]] too if it likes: `gemelo.libraries.arm` then generates a virtual device, and what tick rate is left out.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from gemelo.schemas.device_config import InputRole, Pull, SensorKind
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.robot_record import KeyPart, NotNegative, Pin, Positive, RobotRecord

LEAST_CLEARANCE, MOST_CLEARANCE, CLEARANCE = 0.0005, 0.05, 0.004  # [m] bounds and default of what is kept free
Clearance = Annotated[float, Meta(ge=LEAST_CLEARANCE, le=MOST_CLEARANCE)]  # [m]
AtLeastHalfAStep = Annotated[float, Meta(ge=0.5)]  # rounding to whole steps alone is off by as much


class Transmission(StrEnum):
    """The transmission between output shaft and joint."""

    ROTARY = "rotary"
    RACK_AND_PINION = "rack_and_pinion"


class Driver(RobotRecord, frozen=True, kw_only=True):
    """The timing that a stepper driver requires at its inputs."""

    name: str
    step_high_us: Positive
    step_low_us: Positive
    dir_setup_us: NotNegative
    enable_lead_ms: NotNegative = 0.0


class PullOut(RobotRecord, frozen=True, kw_only=True):
    """The torque that a stepper can give before it loses steps, and what it has to move."""

    speed: tuple[NotNegative, ...]  # [steps/s] rising
    torque: tuple[NotNegative, ...]  # [N m] of the motor shaft at these speeds; 0 beyond the last
    inertia: Positive  # [kg m^2] rotor and load, at the motor shaft
    friction: NotNegative = 0.0  # [N m] at the motor shaft
    full_steps_per_turn: Annotated[int, Meta(ge=4, le=1000)] = 200  # of the motor; it slips by four of them at once


class Motor(RobotRecord, frozen=True, kw_only=True):
    """A stepper behind its driver and gearbox."""

    driver: str  # name of a [[driver]]
    pulses_per_turn: Annotated[int, Meta(le=10_000_000)]  # [pulses/rev] of the motor shaft, microsteps included
    gear_ratio: str = "1"  # exact: motor turns per turn of the output shaft
    step_pin: Pin | None = None
    dir_pin: Pin | None = None
    inverted: bool = False
    pull_out: PullOut | None = None  # None: a motor that never loses a step


class HomingDirection(StrEnum):
    """The limit at which the home switch is."""

    LOWER = "lower"
    UPPER = "upper"


class Homing(RobotRecord, frozen=True, kw_only=True):
    """The homing of a joint, done by the device: fast to its switch, back off, slowly to it again."""

    switch: str  # name of an [[input]]
    direction: HomingDirection
    position: float  # [rad] or [m] where the joint is when the switch closes
    fast: Positive  # [rad/s] or [m/s]
    slow: Positive  # [rad/s] or [m/s]
    back_off: Positive  # [rad] or [m] away from the switch, before the slow approach and at the end
    group: Annotated[int, Meta(ge=0, le=15)] = 0  # joints of one group home together, lower groups first
    max_travel: Positive | None = None  # [rad] or [m] on the way to the switch; None: the joint's travel and a tenth
    timeout: Positive = 60.0  # [s] of the joint's whole homing


class Sketch(RobotRecord, frozen=True, kw_only=True):
    """What an AccelStepper sketch does with a joint, where it is not what the motor's own table says."""

    steps_per_turn: str = ""  # exact: by which the sketch turns degrees into steps; empty: the motor's
    speed: Positive | None = None  # [steps/s] its setMaxSpeed(); None: by max_speed_rpm
    acceleration: Positive | None = None  # [steps/s^2] its setAcceleration(); None: by ramp_time


class StepperJoint(RobotRecord, frozen=True, kw_only=True):
    """One joint's drive; limits tighter than the URDF's win."""

    name: str  # of the URDF joint
    wire_name: str  # on the device and in logs
    motor: Motor
    transmission: Transmission = Transmission.ROTARY
    pinion_radius: float | None = None  # [m] for rack_and_pinion
    max_speed_rpm: float = 15.0  # [rev/min] of the output shaft
    ramp_time: float = 1.0  # [s] from rest to max_speed_rpm: gives the acceleration
    jerk_time: float = 0.1  # [s] from zero to full acceleration: gives the jerk
    mechanical_lower: float | None = None  # [rad] or [m] where the mechanics end; the URDF may not go beyond
    mechanical_upper: float | None = None  # [rad] or [m]
    reference_position: float = 0.0  # [rad] or [m] of the pose that `gemelo reference` declares
    homing: Homing | None = None
    sketch: Sketch | None = None  # dialect = "ra"
    path_tolerance_steps: AtLeastHalfAStep = 4.0  # default of FollowJointTrajectory
    goal_tolerance_steps: AtLeastHalfAStep = 0.75


class PinLevel(StrEnum):
    """Of a pin."""

    HIGH = "high"
    LOW = "low"


class Input(RobotRecord, frozen=True, kw_only=True):
    """A switch or button on the controller board. A contact that opens when pressed also tells of a torn wire."""

    name: KeyPart
    pin: Pin
    role: InputRole
    joint: str = ""  # name of the URDF joint; empty for the e-stop
    active: PinLevel = PinLevel.HIGH  # of the pressed switch
    pull: Pull = Pull.NONE


class DigitalOutput(RobotRecord, frozen=True, kw_only=True):
    """A digital output of the controller board."""

    name: KeyPart
    pin: Pin
    active: PinLevel = PinLevel.HIGH
    at_boot: bool = False
    off_at_estop: bool = False


class Sensor(RobotRecord, frozen=True, kw_only=True):
    """A reading of the controller board: value = raw * scale + offset, raw in mV or in us of the echo."""

    name: KeyPart
    kind: SensorKind
    pin: Pin
    trigger_pin: Pin | None = None  # ultrasonic
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0


class Dialect(StrEnum):
    """What the controller board speaks."""

    GEMELO = "gemelo"  # the frames of firmware/PROTOCOL.md
    RA = "ra"  # MQTT: relative degrees on ra/juntas, for an AccelStepper sketch
    TEXT = "text"  # serial: <SEQ,J1,...,Jn> in radians, answered by <ACK,SEQ,TIMESTAMP_US>


class DeviceRecord(RobotRecord, frozen=True, kw_only=True):
    """The controller board."""

    name: KeyPart  # MQTT: gemelo/v1/<name>/...
    tick_hz: Annotated[int, Meta(ge=10_000, le=100_000, multiple_of=1000)] = 0  # the firmware's bounds; 0: chosen
    queue_capacity: Annotated[int, Meta(ge=2, le=128)] = 128  # [knots], and the firmware's again
    sensor_hz: Annotated[int, Meta(ge=1, le=50)] = 10  # a divisor of 1000
    armed_at_boot: bool = True  # as it is where no enable pin is wired
    enable_pin: Pin | None = None  # of all drivers
    enable_active: PinLevel = PinLevel.LOW
    dialect: Dialect = Dialect.GEMELO
    serial_baud: Annotated[int, Meta(ge=9_600, le=3_000_000)] = 921_600  # of its serial line, as it was provisioned
    message_time: Annotated[float, Meta(ge=0.6, le=10.0)] = 2.0  # [s] that one message of dialect "ra" may take
    # Longer than half a second, and no silence of a second would show that the sketch has lost a message.
    telemetry_time: Annotated[float, Meta(ge=0.01, le=0.5)] = 0.1  # [s] between two words of a sketch of dialect "ra"
    # Assumed for PubSubClient on an ESP32: its loop() takes 60 to 200 us.
    loop_time: Annotated[float, Meta(ge=1e-5, le=0.01)] = 0.0002  # [s] longest pass of that sketch's loop()
    text_hz: Annotated[float, Meta(ge=1.0, le=100.0)] = 25.0  # [Hz] of lines in dialect "text"
    text_decimals: Annotated[int, Meta(ge=2, le=9)] = 6  # of a radian or metre in them; 4 are coarser than many a step


class RobotFile(RobotRecord, frozen=True, kw_only=True):
    """The whole robot.toml."""

    name: KeyPart
    urdf: str = "robot.urdf"
    srdf: str = "robot.srdf"
    group: str = "arm"
    base_frame: str = "base_link"
    tool_frame: str
    clearance: Clearance = CLEARANCE  # [m] that a plan keeps between things that may not touch, unless it says another
    device: DeviceRecord
    driver: tuple[Driver, ...]
    joint: tuple[StepperJoint, ...]
    input: tuple[Input, ...] = ()
    output: tuple[DigitalOutput, ...] = ()
    sensor: tuple[Sensor, ...] = ()
    gripper: Gripper | None = None
