"""An arm without motors, to plan and look at only: robot.toml without [device], [[driver]] and motors, completed.

The generated virtual device has fine steps, and its joints are as fast as the URDF says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

from gemelo.libraries.arm.errors import wrong_file
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint, UrdfModel
from gemelo.schemas.reasons import because, remedy

MAX_NAME = 31  # bytes of a device, the firmware's
MARK = 4  # letters that tell two names apart which are cut
VIRTUAL_DRIVER = "virtual"  # the name of the generated [[driver]]
TO_DRIVE = remedy("write_motors")
NO_MOTORS = because("robot.no_motors")

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_RATE = 32_000.0  # [steps/s] of a joint at full speed: room below half of the highest tick
FINEST, COARSEST = 64_000, 200  # [steps/rev]: a tenth of a mrad where the speed allows it
FINEST_SLIDE = 6_400  # [steps/rev] of the pinion: a hundredth of a mm
PINION_RADIUS = 0.01  # [m]
RAMP_TIME = 0.5  # [s]
UNKNOWN_VELOCITY = 1.0  # [rad/s] or [m/s] where the URDF has none, which is an error of its own

Table = dict[str, object]


def lacks_motors(data: Table, path: Path) -> bool:
    """True if robot.toml has no motor, board or pin; raises `DescriptionError` where only half of it is there."""
    joints = list(_tables(data.get("joint")))
    there = [f"[{key}]" if key == "device" else f"[[{key}]]" for key in ("device", "driver") if data.get(key)]
    there += [f"[[{key}]]" for key in ("input", "output", "sensor") if data.get(key)]
    there += ["[gripper]"] if data.get("gripper") else []
    there += [f"[joint.{key}] ({joint.get('name')})" for joint in joints for key in ("motor", "homing") if key in joint]
    if not there:
        return True
    missing = [word for key, word in (("device", "[device]"), ("driver", "[[driver]]")) if not data.get(key)]
    missing += [f"[joint.motor] ({joint.get('name')})" for joint in joints if "motor" not in joint]
    missing += [] if joints else ["[[joint]]"]
    if not missing:
        return False
    raise wrong_file(path, because("robot.motors.half", present=_few(there), missing=_few(missing)))


def with_virtual_drive(data: Table, model: UrdfModel) -> Table:
    """robot.toml's tables with a device, a driver and a motor for every joint that moves.

    Joints that the file does not name come behind those that it does, in the URDF's order from the root.
    """
    named = {joint.get("name"): joint for joint in _tables(data.get("joint"))}
    moving = {joint.name: joint for joint in driven_joints(model)}
    order = [*named, *(name for name in moving if name not in named)]
    joints = [_joint(named.get(name, {}), name, moving.get(str(name)), number) for number, name in enumerate(order, 1)]
    driver = {"name": VIRTUAL_DRIVER, "step_high_us": 1.0, "step_low_us": 1.0, "dir_setup_us": 1.0}
    return {**data, "device": {"name": device_name(str(data.get("name")))}, "driver": [driver], "joint": joints}


def device_name(robot: str) -> str:
    """The name of a robot's device: the robot's own, cut where the firmware does not keep so many letters."""
    if len(robot.encode()) <= MAX_NAME:
        return robot
    mark = sha256(robot.encode()).hexdigest()[:MARK]  # another robot may begin with the same letters
    return f"{robot[: MAX_NAME - MARK - 1]}_{mark}"


def driven_joints(model: UrdfModel) -> list[UrdfJoint]:
    """Those that need a motor: they move and follow no other. From the root outwards, branches in the file's order."""
    children = {joint.child for joint in model.joints}
    found: list[UrdfJoint] = []
    front = [link for link in reversed(model.link_names) if link not in children]
    seen: set[str] = set()
    while front:
        link = front.pop()
        if link in seen:
            continue
        seen.add(link)
        onward = [joint for joint in model.joints if joint.parent == link]
        found += [joint for joint in onward if joint.kind is not JointKind.FIXED and joint.mimic is None]
        front += [joint.child for joint in reversed(onward)]
    return found


def _joint(written: Table, name: object, joint: UrdfJoint | None, number: int) -> Table:
    """A [[joint]] with what the file says of it, and a motor."""
    limit = joint.limit if joint is not None else None
    velocity = limit.velocity if limit is not None and limit.velocity > 0.0 else UNKNOWN_VELOCITY
    slides = joint is not None and joint.kind is JointKind.PRISMATIC
    is_continuous = joint is not None and joint.kind is JointKind.CONTINUOUS
    travel = math.tau * PINION_RADIUS if slides else math.tau  # for a turn
    rack = {"transmission": "rack_and_pinion", "pinion_radius": PINION_RADIUS} if slides else {}
    table: Table = {
        "name": name,
        "wire_name": f"q{number}",
        "max_speed_rpm": 60.0 * velocity / travel,
        "ramp_time": RAMP_TIME,
        "reference_position": 0.0 if limit is None or is_continuous else _nearest_zero(limit),
        **rack,
        **written,
    }
    rpm = table["max_speed_rpm"]
    turns = rpm / 60.0 if isinstance(rpm, (int, float)) and rpm > 0.0 else 1.0  # [rev/s]
    pulses = max(COARSEST, min(FINEST_SLIDE if slides else FINEST, math.floor(MOST_RATE / turns)))
    return {**table, "motor": {"driver": VIRTUAL_DRIVER, "pulses_per_turn": pulses}}


def _nearest_zero(limit: Limit) -> float:
    """[rad] or [m] within the limits."""
    return min(max(0.0, limit.lower), max(limit.lower, limit.upper))


def _tables(value: object) -> Iterator[Table]:
    """The tables of an array of tables; what else is there is refused where the types are read."""
    if isinstance(value, list):
        yield from (each for each in value if isinstance(each, dict))


def _few(words: list[str]) -> tuple[str, ...]:
    """The first three of them."""
    return (*words[:3], "...") if len(words) > 3 else tuple(words)
