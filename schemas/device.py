"""The messages about the device: status, state, commands, configuration, sensors."""

from __future__ import annotations

from enum import IntEnum, StrEnum

from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason


class DeviceMode(IntEnum):
    """The firmware's states, with the numbers they have on the wire."""

    BOOT = 0
    UNREFERENCED = 1
    HOMING = 2
    IDLE = 3
    RUN = 4
    HOLD = 5
    FAULT = 6
    ESTOP = 7


class DeviceFault(IntEnum):
    """Why the device is in FAULT or ESTOP, with the numbers of the wire."""

    NONE = 0
    TICK_OVERRUN = 1
    INTERNAL = 2
    LIMIT_SWITCH = 3
    HOMING_TIMEOUT = 4
    SWITCH_NOT_FOUND = 5
    SWITCH_STUCK = 6
    EMERGENCY_STOP = 7


class DeviceStatus(Message, frozen=True, kw_only=True):
    """The identity of the device and its connection; latched."""

    stamp: int = 0  # [ns] UNIX time
    online: bool = False
    reason: str = ""  # why it is offline or not usable
    device: str = ""
    firmware: str = ""
    boot_id: int = 0
    reset_cause: str = ""
    joints: int = 0
    tick_hz: int = 0
    queue_capacity: int = 0  # [knots]
    config_crc32: int = 0  # of the configuration that the device works with; 0: none yet
    wanted_crc32: int = 0  # of the one that robot.toml asks for
    virtual: bool = False  # inputs and failures can be injected
    open_loop: bool = False  # it does not say what it has executed: its positions are what was sent
    speaks: bool = False  # its states arrive, also where it cannot be used
    deaf_since: int = 0  # [ns] UNIX time since when it speaks and does not hear; 0: it hears
    warning: str = ""  # what a person has to mend though it is online: two planners, another program on its topics
    heap_free: int = 0  # [bytes] of the board's memory that is free; 0 where it does not say
    heap_least: int = 0  # [bytes] the least that was free since its start
    stack_least: int = 0  # [bytes] the least that was left of a task's stack
    stack_task: str = ""  # whose stack that was
    why: Reason | None = None  # `reason` as data
    warning_why: Reason | None = None  # `warning` as data


class DeviceState(Message, frozen=True, kw_only=True):
    """The state of the device as it reports it, 50 times a second."""

    stamp: int = 0  # [ns] UNIX time of the device's measurement, by clock synchronisation
    device_time: int = 0  # [us] since the device's boot
    boot_id: int = 0
    mode: DeviceMode = DeviceMode.BOOT
    fault: int = 0  # a DeviceFault, or a number that a newer firmware has
    fault_joint: str = ""
    armed: bool = False  # the drivers are energised
    referenced: tuple[bool, ...] = ()  # true for each joint whose position is known
    inputs: tuple[str, ...] = ()  # names of the switches that are active
    outputs: tuple[str, ...] = ()  # names of the outputs that are on
    speed: float = 1.0  # the time scale that a person has asked for
    name: tuple[str, ...] = ()
    steps: tuple[int, ...] = ()  # executed
    velocity: Vector = ()  # [steps/s]
    time_scale: float = 0.0  # 0 stands on the path, 1 runs as planned
    buffered: float = 0.0  # [s] of path in the device's queue
    stream: int = 0
    next_seq: int = 0
    play_time: float = 0.0  # [s] of the stream that has been played
    underruns: int = 0
    refused: int = 0  # chunks and commands that the device has refused since boot
    bad_frames: int = 0
    round_trip: float = 0.0  # [s] latest clock synchronisation
    round_trip_age: float = 0.0  # [s] since that was measured: since the device has answered a question
    is_round_trip_of_wire: bool = True  # False: nothing has come back over the board's own wire yet, or ever does


class DeviceEvent(Message, frozen=True, kw_only=True):
    """Something the device or its link reports once."""

    stamp: int = 0  # [ns] UNIX time
    device: str = ""
    event: str = ""
    detail: str = ""
    client: str = ""  # the node that it is about; empty: everybody
    why: Reason | None = None  # `detail` as data, where it is no word of the device itself


class DeviceCommandKind(IntEnum):
    """The device's commands, with the numbers they have on the wire."""

    HOLD = 1
    RESUME = 2
    STOP = 3
    RESET = 4
    REFERENCE = 5
    ARM = 6
    DISARM = 7
    HOME = 8
    OUTPUT = 9
    SPEED = 10
    STATUS = 11  # the gateway asks for a status
    SERVO = 12  # the gateway moves the gripper


class ResumeCommand(Message, frozen=True, kw_only=True, tag="resume"):
    """Go on along the path that a hold has interrupted."""


class ResetCommand(Message, frozen=True, kw_only=True, tag="reset"):
    """Leave a fault or an emergency stop."""


class ReferenceCommand(Message, frozen=True, kw_only=True, tag="reference"):
    """Declare where joints stand; all of them if none is named."""

    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m] of each joint named; empty: the reference position of robot.toml


class ArmCommand(Message, frozen=True, kw_only=True, tag="arm"):
    """Energise the drivers."""


class HomeCommand(Message, frozen=True, kw_only=True, tag="home"):
    """Let joints find their switches; all that have one if none is named."""

    name: tuple[str, ...] = ()


class OutputCommand(Message, frozen=True, kw_only=True, tag="output"):
    """Switch a digital output of robot.toml."""

    output: str = ""
    on: bool = False


class SpeedCommand(Message, frozen=True, kw_only=True, tag="speed"):
    """Play every path slower from now on, also the present one."""

    scale: float = 1.0  # of the planned speed: 0 stands, 1 as planned


DeviceCommand = (
    ResumeCommand | ResetCommand | ReferenceCommand | ArmCommand | HomeCommand | OutputCommand | SpeedCommand
)


class DeviceCommandRequest(Message, frozen=True, kw_only=True):
    """A command that starts, allows or changes something; what ends a motion is a `DeviceStopRequest`."""

    command: DeviceCommand = ResumeCommand()


class StopKind(StrEnum):
    """The commands that end a motion or disable the drivers."""

    STOP = "stop"  # decelerate along the path and forget the rest of it
    HOLD = "hold"  # decelerate along the path and wait there for a resume
    DISARM = "disarm"  # drivers off; refused while the arm moves, because it would drop


class DeviceStopRequest(Message, frozen=True, kw_only=True):
    """Served before everything else, and never refused for want of room, of a status or of a clock."""

    kind: StopKind = StopKind.STOP


class DeviceCommandResponse(Message, frozen=True, kw_only=True):
    """The device's answer to a command."""

    accepted: bool = False  # the device has confirmed it
    sent: bool = False  # it has left the gateway; where it was not accepted, what the device did is not known
    reason: str = ""
    mode: DeviceMode = DeviceMode.BOOT
    check: str = ""  # "control": somebody else holds it, and the device was not asked
    why: Reason | None = None  # `reason` as data


class DeviceConfiguration(Message, frozen=True, kw_only=True):
    """The configuration that robot.toml asks for, and whether the device works with it; latched."""

    stamp: int = 0  # [ns] UNIX time
    text: str = ""  # the JSON of firmware/PROTOCOL.md
    crc32: int = 0  # of `text`
    device_crc32: int = 0  # of what the device works with; 0: none, or not known
    accepted: bool = False  # the device works with `text`
    reason: str = ""  # why not, with the remedy
    why: Reason | None = None  # `reason` as data


class ConfigureRequest(Message, frozen=True, kw_only=True):
    """Have the device take the configuration of robot.toml; it must be disarmed."""


class ConfigureResponse(Message, frozen=True, kw_only=True):
    """The device's answer to its configuration."""

    accepted: bool = False
    reason: str = ""
    crc32: int = 0
    why: Reason | None = None  # `reason` as data


class SensorReadings(Message, frozen=True, kw_only=True):
    """The readings of the controller board, as long as they are fresh."""

    stamp: int = 0  # [ns] UNIX time of the device's measurement
    name: tuple[str, ...] = ()
    value: Vector = ()  # in the units of robot.toml
    unit: tuple[str, ...] = ()


class ShaftPositions(Message, frozen=True, kw_only=True):
    """The step counters and the true shaft positions, which a virtual device knows both."""

    stamp: int = 0  # [ns] UNIX time
    name: tuple[str, ...] = ()
    steps: tuple[int, ...] = ()  # executed
    shaft: tuple[int, ...] = ()  # steps that the shaft has made
    position: Vector = ()  # [rad] or [m] of the shaft


class InjectKind(StrEnum):
    """The inputs and failures that can be injected into a virtual device."""

    ESTOP = "estop"  # value 1 pressed, 0 released
    SWITCH = "switch"  # target: an input; value 1 held, 0 held open, -1 left to the arm
    BLOCK = "block"  # target: a joint whose shaft is held fast (value 1) or let go (0)
    SLIP = "slip"  # target: a joint; value: steps that its shaft is pushed
    SENSOR = "sensor"  # target: a sensor; value: its reading
    REBOOT = "reboot"
    OFFLINE = "offline"  # value [s] without network
    FREEZE = "freeze"  # value [s] in which the slot task hangs
    DRIFT = "drift"  # value [ppm] by which its clock is fast
    OBJECT = "object"  # value [m] of what stands between the jaws of a servo gripper; 0 takes it away


class InjectRequest(Message, frozen=True, kw_only=True):
    """An injected input or failure; only a virtual device takes it."""

    kind: InjectKind = InjectKind.ESTOP
    target: str = ""
    value: float = 1.0


class InjectResponse(Message, frozen=True, kw_only=True):
    """The virtual device's answer to an injection."""

    accepted: bool = False
    reason: str = ""
    why: Reason | None = None  # `reason` as data


class EchoRequest(Message, frozen=True, kw_only=True):
    """Have the device answer once over its wire; nothing moves."""


class EchoResponse(Message, frozen=True, kw_only=True):
    """What the wire took, without the bus."""

    answered: bool = False
    round_trip: float = 0.0  # [s] gateway to device and back, without the device's own thinking time
    waiting: float = 0.0  # [s] that time: of a board that reads lines, until the next one was due
    reason: str = ""  # why there is no answer
    why: Reason | None = None  # `reason` as data


class CommandChunk(Message, frozen=True, kw_only=True):
    """One chunk of knots as it was sent: rows are knots, columns joints."""

    stamp: int = 0  # [ns] UNIX time of sending
    stream: int = 0
    seq: int = 0
    name: tuple[str, ...] = ()
    dt: float = 0.0  # [s] between knots
    time: float = 0.0  # [s] of the first knot along the stream
    position: tuple[Vector, ...] = ()  # [rad] or [m]
    velocity: tuple[Vector, ...] = ()  # [rad/s] or [m/s]
    acceleration: tuple[Vector, ...] = ()  # [rad/s^2] or [m/s^2]
    steps: tuple[tuple[int, ...], ...] = ()  # [1/256 step] absolute, as on the wire
    step_rate: tuple[tuple[int, ...], ...] = ()  # [1/256 step/s] as on the wire
    replaces: bool = False  # from `time` on the path is this one: once acknowledged, what was sent behind it is void
    tail: int = 0  # of a chunk that replaces: so many knots at its end are the stop, if nothing more comes
    tail_dt: float = 0.0  # [s] between these


class GatewayInputs(Message, frozen=True, kw_only=True):
    """What the gateway's core was given for a while, each with the readings of its clocks; for `gemelo replay`."""

    stamp: int = 0  # [ns] UNIX time of the first
    session: int = 0  # of the gateway's process
    number: int = 0  # of this message in the session, from 0, which has the core's beginning
    inputs: bytes = b""  # zlib of msgpack: services/stepper_gateway/inputs.py


class CommandAck(Message, frozen=True, kw_only=True):
    """The device's answer to a chunk."""

    stamp: int = 0  # [ns] UNIX time of arrival
    stream: int = 0
    seq: int = 0
    code: int = 0
    reason: str = ""
    next_seq: int = 0
    credits: int = 0  # [knots] that would still fit
    buffered: float = 0.0  # [s]
    round_trip: float = 0.0  # [s] from sending to this answer; 0 where nothing has gone over the board's wire for it
    steps: tuple[int, ...] = ()  # executed, latest known at this answer
