"""The steps of a program: frozen structs, told apart in a file by the key `do`. Values are SI: m, rad, s."""

from __future__ import annotations

import re

import msgspec

from gemelo.api.errors import BadArgument
from gemelo.schemas.reasons import because

StepPath = tuple[int, ...]  # from 0: the step's place in its list, after those of the repeats and calls around it


class Step(msgspec.Struct, frozen=True, kw_only=True, tag_field="do", forbid_unknown_fields=True, omit_defaults=True):
    """What all steps have in common."""


class MotionStep(Step, frozen=True, kw_only=True):
    """A motion to one goal: a point, a named state, joint values, a position or pose of the tool, or an offset."""

    point: str = ""  # a taught point
    state: str = ""  # a named state of the SRDF
    joints: dict[str, float] = {}  # [rad] or [m] by joint; those that are not named stay
    position: tuple[float, float, float] | None = None  # [m] of the tool in the base frame
    orientation: tuple[float, float, float, float] | None = None  # unit quaternion (x, y, z, w), with `position`
    rpy: tuple[float, float, float] | None = None  # [rad] the same as roll, pitch and yaw
    along: tuple[float, float, float] | None = None  # direction of the tool's z axis, with `position`
    offset: tuple[float, float, float] | None = None  # [m] from where the tool is when the step begins
    frame: str = ""  # link whose axes `offset` is along; the base if left out
    blend: float = 0.0  # [m] around the goal within which the arm may pass it without a stop


class Go(MotionStep, frozen=True, kw_only=True, tag="go"):
    """A motion of the joints, around what is in the way."""


class Line(MotionStep, frozen=True, kw_only=True, tag="line"):
    """The tool on a straight line."""

    tool_speed: float = 0.0  # [m/s] at most; 0 is as fast as the joints can


class Arc(MotionStep, frozen=True, kw_only=True, tag="arc"):
    """The tool on an arc through a point, or the shorter one about a centre."""

    through: tuple[float, float, float] | None = None  # [m] in the base frame
    center: tuple[float, float, float] | None = None  # [m] in the base frame
    tool_speed: float = 0.0  # [m/s] at most; 0 is as fast as the joints can


class Output(Step, frozen=True, kw_only=True, tag="output"):
    """Switches an output of robot.toml."""

    name: str
    on: bool


class Grip(Step, frozen=True, kw_only=True, tag="grip"):
    """Opens or closes the gripper; what the scene has between its jaws is attached and detached."""

    to: str | float  # "open", "close", or [m] between the jaws


class Pick(Step, frozen=True, kw_only=True, tag="pick"):
    """Takes a thing of cell.toml that a camera sees to a place."""

    thing: str
    place: str
    camera: str = ""  # only this one looks; any if left out


class Wait(Step, frozen=True, kw_only=True, tag="wait"):
    """Stands for a time."""

    time: float  # [s]


class WaitFor(Step, frozen=True, kw_only=True, tag="wait_for"):
    """Stands until a sensor of robot.toml reads more than `above` or less than `below`; fails after `timeout`."""

    sensor: str
    above: float | None = None  # in the sensor's unit
    below: float | None = None  # in the sensor's unit
    timeout: float = 60.0  # [s]


class Speed(Step, frozen=True, kw_only=True, tag="speed"):
    """Every motion after it in the same program, and in the programs that it calls, is planned at this speed."""

    share: float  # of the joints' velocity limits, in (0, 1]; a file says it in per cent: "50%"


class Attach(Step, frozen=True, kw_only=True, tag="attach"):
    """From now on a link carries an object of the scene."""

    object: str
    link: str = ""  # the tool if left out
    touch: tuple[str, ...] = ()  # links that it may touch too


class Detach(Step, frozen=True, kw_only=True, tag="detach"):
    """Leaves a carried object where it is."""

    object: str


class Play(Step, frozen=True, kw_only=True, tag="play"):
    """Goes to where a demonstration begins, and does it again."""

    demonstration: str  # of `gemelo teach list`
    share: float = 1.0  # of the speed at which it was shown, above 0; a file says it in per cent: "50%"


class Repeat(Step, frozen=True, kw_only=True, tag="repeat"):
    """Its steps, `count` times."""

    count: int
    steps: tuple[AnyStep, ...]


class Call(Step, frozen=True, kw_only=True, tag="call"):
    """All steps of another program; its speeds end with it."""

    program: str


AnyStep = Go | Line | Arc | Output | Grip | Pick | Wait | WaitFor | Speed | Attach | Detach | Play | Repeat | Call
KINDS: tuple[type[Step], ...] = (
    Go, Line, Arc, Output, Grip, Pick, Wait, WaitFor, Speed, Attach, Detach, Play, Repeat, Call,
)  # fmt: skip
GOALS = ("point", "state", "joints", "position", "offset")  # of a motion: exactly one of them


def kind_of(step: Step) -> str:
    """The word after `do`: "go", "wait_for", ..."""
    return str(step.__struct_config__.tag)


def goal_of(step: MotionStep) -> str:
    """Which of `GOALS` it has; raises `BadArgument` where it has not exactly one."""
    given = [name for name in GOALS if getattr(step, name)]
    if not given:
        raise BadArgument(because("program.goal.none", known=GOALS))
    if len(given) > 1:
        raise BadArgument(because("program.goal.several", known=GOALS, given=tuple(given)))
    return given[0]


def path_text(path: StepPath) -> str:
    """As a person counts: (2, 0) is "3.1"; the program itself is ""."""
    return ".".join(str(index + 1) for index in path)


def parse_path(text: str) -> StepPath:
    """From "3.1" to (2, 0); raises `BadArgument`."""
    if not re.fullmatch(r"[1-9][0-9]{0,5}(\.[1-9][0-9]{0,5}){0,15}", text):
        raise BadArgument(because("program.step.number", text=text))
    return tuple(int(part) - 1 for part in text.split("."))


def words_of(step: Step) -> str:
    """One line for a person: the kind and what it has been given."""
    given = msgspec.to_builtins(step)
    if isinstance(step, Repeat):
        return f"repeat {step.count} times"
    if isinstance(step, Speed):
        return f"speed {step.share * 100.0:g}%"
    usual = {field.encode_name: field.default for field in msgspec.structs.fields(step)}
    told = {name: value for name, value in given.items() if name != "do" and value != usual.get(name)}
    said = " ".join(f"{name}={_short(value)}" for name, value in told.items())
    return f"{given['do']} {said}"


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_short(each)}" for name, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(_short(each) for each in value) + ")"
    return repr(value) if isinstance(value, str) else str(value)
