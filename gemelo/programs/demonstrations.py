"""Demonstrations: what an arm did while somebody led it, by jogging, a leader arm or the page, kept under a name.

Played back, the arm follows what it was asked for then, sample by sample, as fast or at another speed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path

import msgspec

from gemelo.api.arm import Arm
from gemelo.api.errors import BadArgument, Refused
from gemelo.api.motion import Motion
from gemelo.api.planning import Plan
from gemelo.api.whole_files import write_whole
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.programs.folder import programs_folder
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import checked_folder, program_name
from gemelo.programs.values import FASTEST_PLAYED
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import PlanCode, PlanResponse
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.topics import GRIPPER_STATE, JOINT_COMMANDS

VERSION = 1
AT_REST = 1e-6  # [rad/s] or [m/s] of what a path asks for; rounding
PERIOD = 0.02  # [s] between two samples of an arm that moves: the rate of joint_commands
APART = 0.08  # [s] chosen: nearer samples differ in their last digits alone, which would count as acceleration
SLOWER = 0.95  # of the speed at most, where samples are beyond a limit by their last digits
REST = 0.1  # [s] chosen: of standing that is kept before the first motion and after the last
GRIPPED = 0.001  # [m] by which a target of the gripper is a new one
LOOKED_AT = 0.1  # [s] between two samples that are checked for collisions before they are played

Values = tuple[float, ...]


class Demonstration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Samples of what the path asked for; the gripper's targets beside them."""

    version: int = VERSION
    robot: str
    joints: tuple[str, ...]
    times: Values  # [s] of each sample, from 0
    positions: tuple[Values, ...]  # [rad] or [m], in the order of `joints`
    velocities: tuple[Values, ...]  # [rad/s] or [m/s]
    gripper: tuple[tuple[float, float], ...] = ()  # [s] from the beginning, and [m] between the jaws

    @property
    def duration(self) -> float:
        """[s] at the speed at which it was shown."""
        return self.times[-1]

    @property
    def start(self) -> dict[str, float]:
        """[rad] or [m] by joint where it begins."""
        return dict(zip(self.joints, self.positions[0], strict=True))

    @property
    def end(self) -> dict[str, float]:
        """[rad] or [m] by joint where it ends."""
        return dict(zip(self.joints, self.positions[-1], strict=True))


class Demonstrations(Mapping[str, Demonstration]):
    """Those of one robot in the folder of programs, by name: `<folder>/<robot>.demonstrations/<name>.json`."""

    def __init__(self, folder: str | Path, robot: ArmDescription) -> None:
        self.folder = checked_folder(folder) / f"{robot.name}.demonstrations"

    def __getitem__(self, name: str) -> Demonstration:
        """Raises KeyError where there is none, `ProgramError` where its file is wrong."""
        if name not in self:
            raise KeyError(name)
        file = self.file(name)
        try:
            found = msgspec.json.decode(file.read_bytes(), type=Demonstration)
        except (OSError, msgspec.DecodeError) as error:
            what = because("demonstration.unreadable", error=str(error))
            raise ProgramError([Mistake(str(file), 0, (), what)]) from error
        count, width = len(found.times), len(found.joints)
        rows = (*found.positions, *found.velocities)
        is_whole = count > 1 and len(found.positions) == len(found.velocities) == count
        if found.version != VERSION or not is_whole or any(len(row) != width for row in rows):
            what = because("demonstration.form", version=VERSION)
            raise ProgramError([Mistake(str(file), 0, (), what)])
        return found

    def __contains__(self, name: object) -> bool:
        with suppress(BadArgument):
            return isinstance(name, str) and self.file(name).is_file()
        return False

    def __iter__(self) -> Iterator[str]:
        names = sorted(path.stem for path in self.folder.glob("*.json"))
        return (name for name in names if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def file(self, name: str) -> Path:
        """The file of that name, which need not exist; raises `BadArgument`."""
        return self.folder / f"{program_name(name)}.json"

    def require(self, name: str) -> Demonstration:
        """Raises `BadArgument` with the nearest name where there is none, `ProgramError` where its file is wrong."""
        self.file(name)
        if name not in self:
            raise BadArgument(because("demonstration.unknown", nearest(name, list(self)), name=name))
        return self[name]

    def require_new(self, name: str, *, overwrite: bool = False) -> None:
        """Raises `BadArgument` where there is one of that name, unless it is to `overwrite`."""
        if self.file(name).exists() and not overwrite:
            raise BadArgument(because("demonstration.there", name=name))

    def save(self, name: str, demonstration: Demonstration, *, overwrite: bool = False) -> Path:
        """Writes it, and returns its file; raises as `require_new`, and `Error` where it cannot be written."""
        self.require_new(name, overwrite=overwrite)
        file = self.file(name)
        write_whole(file, msgspec.json.encode(demonstration))
        return file


def demonstrations_of(arm: Arm) -> Demonstrations:
    """Those in the arm's folder of programs."""
    return Demonstrations(programs_folder(arm), arm.description)


def record_demonstration(arm: Arm, is_over: Callable[[], bool], timeout: float | None = None) -> Demonstration:
    """What the arm is asked for until `is_over()`, or for `timeout` [s], without the rests at both ends.

    Whatever moves it is recorded. Raises `BadArgument` where nothing has moved.
    """
    samples: list[JointState] = []
    grips: list[tuple[int, float]] = []  # [ns] and [m]

    def on_gripper(state: GripperState) -> None:
        if state.known and (not grips or abs(state.target - grips[-1][1]) > GRIPPED):
            grips.append((state.stamp, state.target))

    with ExitStack() as listening:
        listening.callback(arm.node.subscribe(JOINT_COMMANDS, samples.append).close)
        if arm.description.gripper is not None:
            listening.callback(arm.node.subscribe(GRIPPER_STATE, on_gripper).close)
        arm.wait_for(is_over, timeout)
    return _trimmed(arm.description, list(samples), grips[1:])  # the first is how it was before


def _trimmed(robot: ArmDescription, samples: list[JointState], grips: list[tuple[int, float]]) -> Demonstration:
    moved = [index for index, each in enumerate(samples) if any(abs(speed) > AT_REST for speed in each.velocity)]
    if not moved:
        raise BadArgument(because("demonstration.still", robot=robot.name))
    if moved[0] == 0 or moved[-1] == len(samples) - 1:
        raise BadArgument(because("demonstration.moving", robot=robot.name))
    begin = samples[moved[0]].stamp - round((REST + PERIOD) * 1e9)
    still = (0.0,) * len(robot.joint_names)
    rows = [(0.0, _ordered(robot, samples[moved[0] - 1]), still)]
    for each in samples[moved[0] : moved[-1] + 2]:
        time, velocity = (each.stamp - begin) * 1e-9, _ordered(robot, each, of_velocity=True)
        last, place, speed = rows[-1]
        if speed == still and velocity != still and time - last > 2.0 * PERIOD:  # it rested until just before
            rows.append((time - PERIOD, place, still))
        if time > last and (velocity == still or rows[-1][2] == still or time - rows[-1][0] >= APART):
            rows.append((time, _ordered(robot, each), velocity))
    rows[-1] = (rows[-1][0], rows[-1][1], still)
    rows.append((rows[-1][0] + REST, rows[-1][1], still))
    return Demonstration(
        robot=robot.name,
        joints=robot.joint_names,
        times=tuple(time for time, _, _ in rows),
        positions=tuple(position for _, position, _ in rows),
        velocities=tuple(velocity for _, _, velocity in rows),
        gripper=tuple((max(0.0, (stamp - begin) * 1e-9), to) for stamp, to in grips),
    )


def _ordered(robot: ArmDescription, state: JointState, *, of_velocity: bool = False) -> Values:
    values = dict(zip(state.name, state.velocity if of_velocity else state.position, strict=True))
    return tuple(values[name] for name in robot.joint_names)


def plan_of(demonstration: Demonstration, speed: float = 1.0) -> Plan:
    """Its samples as a plan, `speed` times as fast (a share, above 1 for faster): the path is the same."""
    points = tuple(
        TrajectoryPoint(
            positions=position, velocities=tuple(speed * each for each in velocity), time_from_start=time / speed
        )
        for time, position, velocity in zip(
            demonstration.times, demonstration.positions, demonstration.velocities, strict=True
        )
    )
    trajectory = JointTrajectory(joint_names=demonstration.joints, points=points)
    duration = demonstration.duration / speed
    return Plan(demonstration.robot, {}, PlanResponse(code=PlanCode.SUCCESS, trajectory=trajectory, duration=duration))


def play_demonstration(
    arm: Arm, demonstration: Demonstration, speed: float = 1.0, is_cancelled: Callable[[], bool] = lambda: False
) -> Motion:
    """The arm goes to where it begins, by a plan, and does it again, `speed` times as fast (a share).

    Its samples are checked against arm and scene before. Raises `Refused`, `Aborted`, `Lost` or `BadArgument`.
    """
    if not 0.0 < speed <= FASTEST_PLAYED:
        raise BadArgument(because("demonstration.speed", value=speed, most=FASTEST_PLAYED))
    require_same_arm(arm, demonstration)
    require_free(arm, demonstration)
    there = _followed(arm, arm.start(joints=demonstration.start), is_cancelled)
    if is_cancelled():
        return there
    motion = arm.start(plan_of(demonstration, within_limits(demonstration, arm.description, speed)))
    try:
        for time, opening in demonstration.gripper:
            arm.wait_for(lambda at=time / speed: motion.is_over or is_cancelled() or motion.elapsed >= at)  # type: ignore[misc]
            if is_cancelled() or (motion.is_over and motion.status is not GoalStatusCode.SUCCEEDED):
                break
            arm.grip(opening, is_cancelled=is_cancelled)
    except BaseException:
        motion.cancel()
        raise
    return _followed(arm, motion, is_cancelled)


def _followed(arm: Arm, motion: Motion, is_cancelled: Callable[[], bool]) -> Motion:
    """To its end; where it is cancelled the arm decelerates, and `Canceled` is raised."""
    try:
        arm.wait_for(lambda: motion.is_over or is_cancelled())
    finally:
        if not motion.is_over:
            motion.cancel()
    return motion.wait()


def require_same_arm(arm: Arm, demonstration: Demonstration) -> None:
    """Raises `BadArgument` for a demonstration of another arm."""
    if demonstration.robot != arm.name:
        raise BadArgument(because("demonstration.robot", robot=demonstration.robot, present=arm.name))


def within_limits(demonstration: Demonstration, robot: ArmDescription, speed: float) -> float:
    """The share `speed`, or down to `SLOWER` of it where the samples need that to be within the joints' limits.

    What is beyond them by more is refused by the gateway, with the joint.
    """
    most = 1.0
    for column, joint in enumerate(map(robot.joint, demonstration.joints)):
        times = demonstration.times
        places = [row[column] for row in demonstration.positions]
        speeds = [row[column] for row in demonstration.velocities]
        for index in range(len(times) - 1):
            span, step = times[index + 1] - times[index], places[index + 1] - places[index]
            first, last = speeds[index], speeds[index + 1]
            middle = 1.5 * step / span - 0.25 * (first + last)  # of the cubic between the two
            bends = (6.0 * step / span - 4.0 * first - 2.0 * last, 4.0 * last + 2.0 * first - 6.0 * step / span)
            fastest = max(abs(first), abs(middle), abs(last)) / joint.velocity
            hardest = max(map(abs, bends)) / span / joint.acceleration
            most = max(most, speed * fastest, speed * hardest**0.5)
    return speed * max(SLOWER, 1.0 / most * (1.0 - 1e-6) if most > 1.0 else 1.0)


def require_free(arm: Arm, demonstration: Demonstration) -> None:
    """Raises `Refused` with the time at which the arm would touch itself or the scene as that is now."""
    looked = -LOOKED_AT
    for time, position in zip(demonstration.times, demonstration.positions, strict=True):
        if time - looked < LOOKED_AT and time < demonstration.duration:
            continue
        looked = time
        try:
            arm.check(dict(zip(demonstration.joints, position, strict=True)))
        except Refused as refused:
            why = because("demonstration.touches", refused.reason, remedy("demonstrate_anew"), time=time)
            raise Refused(
                because("client.refused", why), check=refused.check, subject=refused.subject, reason=why
            ) from refused
