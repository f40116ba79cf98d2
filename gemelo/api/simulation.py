"""A twin inside one process, for the tests of your own programs: the real services, in virtual time.

    with gemelo.simulate("rm1") as arm:
        arm.move(named="ready")
        arm.sim.press("estop")

Nothing runs besides, and nothing is left behind. Virtual time passes only while the program waits for the arm, or in
`arm.sim.sleep`; a program that calls `time.sleep` waits for nothing.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self, overload

import msgspec
from msgspec.structs import replace

from gemelo.api.arguments import Joints
from gemelo.api.arm import Arm
from gemelo.api.errors import BadArgument, Error, imported, reason_of
from gemelo.api.robot_files import Robot, load_robot
from gemelo.api.session import Session
from gemelo.api.targets import named_joints, require_joint, require_within
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.reasons import because
from gemelo.schemas.robot import Motor
from gemelo.schemas.simulation import WireConditions

if TYPE_CHECKING:
    from gemelo.tools.simulation.twin import Twin
    from gemelo.tools.simulation.virtual_clock import VirtualClock

ROOM = "gemelo.tools.simulation"  # imported when a simulation begins: it stands on all services
PROGRAM = "program"  # the node of a connection, if it is not named
UNREFERENCED = "unreferenced"  # a start of which the board does not know where the joints stand

# The value of `arm.device.inject` for each word of `gemelo device press`; None: the last word after it.
BUTTONS: dict[str, tuple[str, float | None]] = {
    "estop": ("estop", 1.0),
    "release": ("estop", 0.0),
    "block": ("block", 1.0),
    "free": ("block", 0.0),
    "slip": ("slip", None),
    "switch": ("switch", None),
    "sensor": ("sensor", None),
    "object": ("object", None),
    "reboot": ("reboot", 1.0),
    "offline": ("offline", None),
    "freeze": ("freeze", None),
    "drift": ("drift", None),
}
MOST_TORQUE = 10.0  # share of a motor's own
PRESSED = 0.05  # [s] after which the gateway knows what was pressed: the board says it within two states
HELD = {"on": 1.0, "off": 0.0, "auto": -1.0}  # of a switch

Motors = Mapping[str, float | Motor]  # by joint: its motor, or the share that is left of its pull-out torque
Wire = WireConditions | Mapping[str, float]


class Simulation:
    """Any number of arms in one virtual time.

    >>> with gemelo.Simulation(seed=7) as simulation:
    ...     left, right = simulation.add("rm1"), simulation.add("parol6")
    ...     left.name, right.name
    ('rm1', 'parol6')
    """

    def __init__(self, *, seed: int = 1, time_scale: float | None = None) -> None:
        """`seed`: of everything that is drawn; the same one gives the same bytes. `time_scale`: virtual seconds in a
        real one, 1.0 is real time; as fast as the machine computes if left out."""
        try:
            self._clock: VirtualClock = imported(f"{ROOM}.virtual_clock").VirtualClock(seed, time_scale)
        except ValueError as error:
            raise BadArgument(because("argument.time_scale", value=str(time_scale))) from error
        self._folder = tempfile.TemporaryDirectory(prefix="gemelo-simulation-")
        self._twins: list[Twin] = []
        self.arms: list[SimulatedArm] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @property
    def now(self) -> float:
        """[s] of virtual time since the beginning.

        >>> with gemelo.Simulation() as simulation:
        ...     simulation.now
        0.0
        """
        return self._clock.now * 1e-9

    def sleep(self, seconds: float) -> None:
        """Lets so much virtual time pass [s].

        >>> with gemelo.Simulation() as simulation:
        ...     simulation.sleep(2.0)
        ...     simulation.now
        2.0
        """
        self._clock.sleep(seconds)

    def add(
        self,
        robot: str | Path | Robot = "",
        *,
        cell: str | Path = "",
        motors: Motors | None = None,
        wire: Wire | None = None,
        start: str | Joints | None = None,
        name: str = "",
    ) -> SimulatedArm:
        """Another arm, ready to move; see `simulate`. `name`: of the node of this connection.

        >>> with gemelo.Simulation() as simulation:
        ...     simulation.add("rm1", start="left").joints["brazo_joint"] > 0.5
        True
        """
        found = robot if isinstance(robot, Robot) else load_robot(str(robot))
        deployment = replace(found.deployment, robot=str(found.description.folder), arms="")
        deployment = replace(deployment, cell=str(Path(cell).resolve()) if cell else "")
        arm = found.description
        twin = self._twin(
            arm,
            deployment,
            start=imported(f"{ROOM}.twin").Start(*_start(arm, start)),
            motors=_motors(arm, motors or {}),
            wire=_wire(wire),
        )
        self._twins.append(twin)
        node = Node(name or PROGRAM, twin.deployment, robot=arm.name, bus=twin.bus(), log_level="warning")
        connected = SimulatedArm(Session(twin.deployment, arm, node), self, twin)
        self.arms.append(connected)
        self._clock.keep_pace()
        return connected

    def close(self) -> None:
        """Ends it whole; may be called twice.

        >>> gemelo.Simulation().close()
        """
        try:
            while self.arms:
                self.arms.pop()._leave()
        finally:
            while self._twins:
                self._twins.pop().close()
            self._folder.cleanup()

    def _twin(self, arm: ArmDescription, deployment: object, **options: object) -> Twin:
        folder = Path(self._folder.name) / f"{len(self._twins)}-{arm.name}"
        room = imported(f"{ROOM}.twin")
        try:
            twin: Twin = room.Twin(self._clock, arm, deployment, folder, **options)
        except room.NotReady as error:
            raise Error(reason_of(error)) from error
        except room.MissingPart as error:
            raise Error(reason_of(error)) from error
        return twin


class SimulatedArm(Arm):
    """An `Arm` whose twin is simulated; `sim` is what only a simulation has.

    >>> with gemelo.simulate("rm1") as simulated:
    ...     simulated.sim.press("estop")
    ...     simulated.device.mode.name
    'ESTOP'
    """

    def __init__(self, session: Session, simulation: Simulation, twin: Twin) -> None:
        super().__init__(session)
        self.sim = SimulatedWorld(self, simulation, twin)

    def close(self) -> None:
        """Ends the connection, and the simulation with its last arm.

        >>> gemelo.simulate("rm1").close()
        """
        simulation = self.sim.simulation
        self._leave()
        if self in simulation.arms:
            simulation.arms.remove(self)
        if not simulation.arms:
            simulation.close()

    def _leave(self) -> None:
        super().close()


class SimulatedWorld:
    """What only a simulation has: its time, and hands and accidents at the virtual device.

    >>> with gemelo.simulate("rm1") as simulated:
    ...     simulated.sim.cut_wire()
    ...     simulated.sim.sleep(1.0)
    ...     simulated.device.status.online
    False
    """

    def __init__(self, arm: Arm, simulation: Simulation, twin: Twin) -> None:
        self._arm, self.simulation, self._twin = arm, simulation, twin

    @property
    def now(self) -> float:
        """[s] of virtual time since the beginning.

        >>> with gemelo.simulate("rm1") as simulated:
        ...     0.0 < simulated.sim.now < 1.0
        True
        """
        return self.simulation.now

    def sleep(self, seconds: float) -> None:
        """Lets so much virtual time pass [s].

        >>> with gemelo.simulate("rm1") as simulated:
        ...     motion = simulated.start(named="left")
        ...     simulated.sim.sleep(0.5)
        ...     0.0 < motion.progress < 1.0
        True
        """
        self.simulation.sleep(seconds)

    def connect(self, name: str = "") -> Arm:
        """Another connection to the same arm, as another program has it; `name`: of its node.

        >>> with gemelo.simulate("rm1") as simulated, simulated.sim.connect("second") as second:
        ...     second.joints == simulated.joints
        True
        """
        twin = self._twin
        node = Node(name or "other", twin.deployment, robot=twin.arm.name, bus=twin.bus(), log_level="warning")
        return Arm(Session(twin.deployment, twin.arm, node))

    def press(self, what: str, *words: str | float) -> None:
        """As `gemelo device press`: "estop", "release", "block" JOINT, "free" JOINT, "slip" JOINT STEPS, "switch" INPUT
        "on" | "off" | "auto", "sensor" SENSOR VALUE, "object" WIDTH [m], "reboot", "offline" [s], "freeze" [s],
        "drift" [ppm]. Raises `BadArgument`, or `Refused` with the device's reason.

        >>> with gemelo.simulate("rm1") as simulated:
        ...     simulated.sim.press("sensor", "ultra", 25.0)
        ...     round(simulated.sensors["ultra"])
        25
        """
        if what not in BUTTONS:
            raise BadArgument(because("argument.press.unknown", nearest(what, BUTTONS), name=what))
        kind, value = BUTTONS[what]
        rest = list(words)
        if value is None:
            if not rest:
                raise BadArgument(because("argument.press.no_value", name=what))
            last = rest.pop()
            if isinstance(last, str) and last not in HELD:
                raise BadArgument(because("argument.press.value", name=what, value=repr(last), words=tuple(HELD)))
            value = HELD[last] if isinstance(last, str) else last
        if len(rest) > 1 or any(not isinstance(each, str) for each in rest):
            raise BadArgument(because("argument.press.too_many", name=what, given=repr(words)))
        self._arm.device.inject(kind, str(rest[0]) if rest else "", value)
        self.sleep(PRESSED)

    def node(self, name: str) -> Node:
        """A node of your own on the arm's bus, to be closed by you.

        >>> with gemelo.simulate("rm1") as simulated, simulated.sim.node("watcher") as watcher:
        ...     states = watcher.latest(gemelo.topics.JOINT_STATES)
        ...     watcher.wait(0.2)
        ...     states.age() < 0.11
        True
        """
        twin = self._twin
        return Node(name, twin.deployment, robot=twin.arm.name, bus=twin.bus(), log_level="warning")

    def cut_wire(self) -> None:
        """Nothing goes between gateway and board any more, and the gateway knows it.

        >>> with gemelo.simulate("rm1") as simulated:
        ...     simulated.sim.cut_wire()
        """
        self._twin.wire.cut()

    def restore_wire(self) -> None:
        """Ends `cut_wire`.

        >>> with gemelo.simulate("rm1") as simulated:
        ...     simulated.sim.cut_wire()
        ...     simulated.sim.restore_wire()
        """
        self._twin.wire.restore()


class SimulatedArms(tuple[SimulatedArm, ...]):
    """Several arms of one simulation, as a context that ends it.

    >>> with gemelo.simulate("rm1", "parol6") as (first, second):
    ...     first.name, second.name
    ('rm1', 'parol6')
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for arm in self:
            arm.sim.simulation.close()


@overload
def simulate(
    robot: str | Path | Robot = "",
    /,
    *,
    seed: int = 1,
    cell: str | Path = "",
    motors: Motors | None = None,
    wire: Wire | None = None,
    start: str | Joints | None = None,
    time_scale: float | None = None,
) -> SimulatedArm:
    """One arm; `time_scale` [s/s] as below."""


@overload
def simulate(
    robot: str | Path | Robot,
    second: str | Path | Robot,
    /,
    *others: str | Path | Robot,
    seed: int = 1,
    cell: str | Path = "",
    motors: Motors | None = None,
    wire: Wire | None = None,
    start: str | Joints | None = None,
    time_scale: float | None = None,
) -> SimulatedArms:
    """Several arms; `time_scale` [s/s] as below."""


def simulate(
    *robots: str | Path | Robot,
    seed: int = 1,
    cell: str | Path = "",
    motors: Motors | None = None,
    wire: Wire | None = None,
    start: str | Joints | None = None,
    time_scale: float | None = None,
) -> SimulatedArm | SimulatedArms:
    """A twin inside this process: the same `Arm` as that of `connect`, in virtual time.

    `robots`: names of folders of urdf/, or paths, the deployment's if left out; several share one time. `seed`: the
    same one gives the same bytes. `cell`: a cell.toml, with which cameras see. `motors`: by joint, the share that is
    left of its pull-out torque (0.3: it loses steps early), or another motor. `wire`: delay [s], jitter [s] and loss
    between gateway and board. `start`: a named state, joint values [rad] or [m], or "unreferenced"; if left out, the
    reference pose, referenced. The arm is armed in any case. `time_scale`: 1.0 is real time; as fast as the machine
    computes if left out.

    Raises `Error` where a part of the installation is missing or the twin does not become ready, and `BadArgument`.

    >>> with gemelo.simulate("rm1", start="left") as simulated:
    ...     simulated.move(named="home").status.name
    'SUCCEEDED'
    """
    simulation = Simulation(seed=seed, time_scale=time_scale)
    try:
        for robot in robots or ("",):
            simulation.add(robot, cell=cell, motors=motors, wire=wire, start=start)
    except BaseException:
        simulation.close()
        raise
    return simulation.arms[0] if len(robots) < 2 else SimulatedArms(simulation.arms)


def _start(arm: ArmDescription, start: str | Joints | None) -> tuple[Mapping[str, float] | None, bool]:
    """Where the board was switched off, by joint, and whether it knows that."""
    if start is None or start == UNREFERENCED:
        return None, start is None
    if isinstance(start, str):
        states = arm.named_states
        if start not in states:
            known = [*states, UNREFERENCED]
            raise BadArgument(because("argument.start.unknown", nearest(start, known), name=start, robot=arm.name))
        values = {name: value for name, value in zip(arm.joint_names, states[start], strict=True) if value is not None}
    else:
        values = named_joints(arm, start, "start")
    require_within(arm, values, rounded=True)
    return values, True


def _motors(arm: ArmDescription, changed: Motors) -> tuple[Motor, ...]:
    """One motor for each joint; raises `BadArgument` for a joint that there is not, or without figures of its motor."""
    for name in changed:
        require_joint(arm, name)
    return tuple(_motor(joint, changed.get(joint.name, 1.0)) for joint in arm.joints)


def _motor(joint: Joint, changed: float | Motor) -> Motor:
    if isinstance(changed, Motor):
        return changed
    motor, share = joint.drive.motor, float(changed)
    if share == 1.0:
        return motor
    if motor.pull_out is None:
        raise BadArgument(because("argument.motors.no_curve", joint=joint.name))
    if not 0.0 <= share <= MOST_TORQUE:
        raise BadArgument(because("argument.motors.share", joint=joint.name, value=share, most=MOST_TORQUE))
    torque = tuple(share * each for each in motor.pull_out.torque)
    return replace(motor, pull_out=replace(motor.pull_out, torque=torque))


def _wire(wire: Wire | None) -> WireConditions:
    if isinstance(wire, WireConditions):
        return wire
    try:
        return msgspec.convert(dict(wire or {}), WireConditions)
    except msgspec.ValidationError as error:
        given = str(dict(wire or {}))
        raise BadArgument(because("argument.wire", wire=given, error=str(error))) from error
