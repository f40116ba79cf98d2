"""Random sequences of everything that people, targets and failing parts do: whatever happens, the arm stays safe."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, HomeCommand, ReferenceCommand
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.virtual_arm.gateway_driver import CancelInput, TargetsInput, asked
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.profiles import examples
from tests.stepper_gateway.harness import assert_within_limits, move

JOINTS = rm1().joints
LONGEST_GOAL = 12.0  # [s] of path and bridge
PATIENCE = 30.0  # [s] in which a goal must end: its path, its tolerance, the stop, and a link that is away for a while


class Play:
    """A rig, what was done to it, and what must hold meanwhile."""

    def __init__(self, wire: VirtualWire, seed: int) -> None:
        self.rig = VirtualArm(wire, seed=seed).ready()
        self.accepted: dict[str, float] = {}  # [s] when
        self.ends: dict[str, Vector] = {}  # of the goals that were accepted
        self.tickets = 0
        self.boot = 77
        self.quiet_since = 0  # [ms] since the last reboot

    def wait(self, seconds: float) -> None:
        self.rig.run(seconds)
        self.check()

    def check(self) -> None:
        rig = self.rig
        assert rig.device.max_slot_error <= 128
        for joint, steps in zip(JOINTS, rig.device.commanded_steps, strict=True):
            low, high = joint.steps.to_steps(joint.lower), joint.steps.to_steps(joint.upper)
            # It boots on a whole step, which may lie half a step beyond the limit that it stood on.
            slack = 1 / 64 if self.boot == 77 else 0.51
            assert low - slack <= steps <= high + slack, f"{joint.name} at {steps}"
        for goal_id, since in self.accepted.items():
            assert goal_id in rig.finished or rig.now - since < PATIENCE, f"{goal_id} does not end"

    def here(self) -> Vector:
        states = self.rig.messages(JOINT_STATES)
        return states[-1].position if states else self.rig.position

    def goal(self, trajectory: JointTrajectory, time_tolerance: float = 0.0, after: str = "") -> None:
        goal_id = f"g{len(self.accepted)}"
        goal = FollowJointTrajectoryGoal(trajectory=trajectory, goal_time_tolerance=time_tolerance, after=after)
        if self.rig.goal(goal, goal_id).accepted:
            self.ends[goal_id] = trajectory.points[-1].positions
            if after:
                self.accepted[goal_id] = self.accepted[after] + LONGEST_GOAL
                return
            self.accepted[goal_id] = self.rig.now + max(0.0, trajectory.stamp * 1e-9 - self.rig.moment.unix * 1e-9)

    def command(self, kind: DeviceCommandKind, value: float = 0.0) -> None:
        """A reference is taken where the arm stands: the count of a joint that is told another place jumps."""
        self.tickets += 1
        is_reference = kind == DeviceCommandKind.REFERENCE
        here = dict(zip(rm1().joint_names, self.here(), strict=True)) if is_reference else {}
        fields = {"name": tuple(here), "position": tuple(here.values()), "output": "avanzar", "on": value > 0.0}
        self.rig.ask(asked(kind, **fields, scale=value), self.tickets)

    def home(self, seconds: float) -> None:
        """One joint looks for its switch, for so long; its way is not the gateway's, and its count jumps."""
        self.finish_track()
        self.tickets += 1
        self.rig.ask(HomeCommand(name=("efector_joint",)), self.tickets)
        if self.rig.run(0.5, lambda: self.rig.device.mode == DeviceMode.HOMING):
            self.rig.run(seconds, lambda: self.rig.device.mode != DeviceMode.HOMING)
            if self.rig.device.mode == DeviceMode.HOMING:
                self.command(DeviceCommandKind.STOP)
                self.rig.run(5.0, lambda: self.rig.device.mode != DeviceMode.HOMING)
            self.quiet_since = len(self.rig.path)
            self.place_within()

    def press_estop(self, seconds: float) -> None:
        """The arm stops dead, which is no braking; then somebody brings it back."""
        self.finish_track()
        self.rig.device.press_input(0, True)
        self.wait(seconds)
        self.rig.device.press_input(0, None)
        self.wait(0.1)
        self.revive()
        self.quiet_since = len(self.rig.path)

    def revive(self) -> None:
        """What a person does who follows the refusals."""
        kinds = (DeviceCommandKind.RESET, DeviceCommandKind.ARM, DeviceCommandKind.REFERENCE)
        for kind in kinds if self.rig.device.mode != DeviceMode.UNREFERENCED else kinds[1:]:
            self.command(kind)
            self.rig.run(0.5)

    def place_within(self) -> None:
        """A homing that was stopped beyond the limits is brought back by hand, and declared."""
        if self.rig.device.mode == DeviceMode.UNREFERENCED:
            self.tickets += 1
            self.rig.ask(ReferenceCommand(), self.tickets)
            self.rig.run(0.5)
            self.quiet_since = len(self.rig.path)
            device = self.rig.device
            for joint, (counted, true) in enumerate(zip(device.steps, device.shaft, strict=True)):
                device.slip(joint, counted - true)

    def reboot(self, referenced: bool) -> None:
        self.finish_track()
        self.boot += 1
        self.rig.reboot(self.boot, referenced and not self.rig.device.moving)

    def finish_track(self) -> None:
        """The path so far kept the limits; what follows is judged by itself."""
        if len(self.rig.path) == self.quiet_since:
            return
        assert_within_limits(self.rig, self.quiet_since)
        for before, after in pairwise(self.rig.path[self.quiet_since :]):
            for joint, a, b in zip(JOINTS, before, after, strict=True):
                fastest = joint.velocity * joint.steps.per_unit * 1e-3
                assert abs(b - a) <= max(1.0, 1.005 * fastest), f"{joint.name} jumps {b - a} steps"
        self.quiet_since = len(self.rig.path)


Action = Callable[[Play], None]
shares = st.tuples(*[st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 1.0]))] * 3)


def place(share: Vector) -> Vector:
    return tuple(j.lower + s * (j.upper - j.lower) for j, s in zip(JOINTS, share, strict=True))


def near(play: Play, share: Vector, reach: float) -> Vector:
    """Part of the way from here to a place."""
    return tuple(a + reach * (b - a) for a, b in zip(play.here(), place(share), strict=True))


def point(positions: Vector, time: float, rests: bool = False) -> JointTrajectory:
    velocities = (0.0,) * 3 if rests else ()
    points = (TrajectoryPoint(positions=positions, velocities=velocities, time_from_start=time),)
    return JointTrajectory(joint_names=rm1().joint_names, points=points)


def planned(share: Vector, reach: float, delay: float, tolerance: float) -> Action:
    def act(play: Play) -> None:
        plan = move(play.here(), near(play, share, reach))
        stamp = play.rig.moment.unix + round(delay * 1e9) if delay else 0
        play.goal(JointTrajectory(stamp=stamp, joint_names=plan.joint_names, points=plan.points), tolerance)

    return act


def following(share: Vector, reach: float) -> Action:
    """A goal from the end of the last one, while that is under way or just after it."""

    def act(play: Play) -> None:
        if play.ends:
            last, start = list(play.ends.items())[-1]
            end = tuple(a + reach * (b - a) for a, b in zip(start, place(share), strict=True))
            play.goal(move(start, end), after=last)

    return act


def corners(share: Vector, reach: float, count: int, time: float) -> Action:
    def act(play: Play) -> None:
        start, end = play.here(), near(play, share, reach)
        rows = [tuple(a + (b - a) * i / count for a, b in zip(start, end, strict=True)) for i in range(count + 1)]
        points = tuple(TrajectoryPoint(positions=row, time_from_start=time * i) for i, row in enumerate(rows))
        play.goal(JointTrajectory(joint_names=rm1().joint_names, points=points))

    return act


def stream(share: Vector, reach: float, count: int, period: float) -> Action:
    def act(play: Play) -> None:
        for _ in range(count):
            target = JointTargets(name=rm1().joint_names, position=near(play, share, reach))
            play.rig.handle(TargetsInput(target))
            play.wait(period)

    return act


def link(seconds: float, at_the_broker: bool) -> Action:
    def act(play: Play) -> None:
        if at_the_broker:
            play.rig.link(False)
            play.wait(seconds)
            play.rig.link(True)
        else:
            play.rig.wire.is_cut = True
            play.wait(seconds)
            play.rig.wire.is_cut = False
            play.rig.device.report_status()  # the broker has kept it

    return act


def freeze(seconds: float) -> Action:
    def act(play: Play) -> None:
        play.rig.gateway_is_on = False
        play.wait(seconds)
        play.rig.gateway_is_on = True
        play.rig.device.report_status()  # the broker has kept it

    return act


def restart(play: Play) -> None:
    """The gateway's process dies with its goals and comes back."""
    for goal_id in play.accepted:
        if goal_id not in play.rig.finished:
            play.accepted[goal_id] = float("inf")
    play.rig.new_gateway()


PAUSES = (DeviceCommandKind.HOLD, DeviceCommandKind.RESUME)
NOT_PLAIN = (DeviceCommandKind.HOME, DeviceCommandKind.SPEED, DeviceCommandKind.STATUS)
PLAIN = [kind for kind in DeviceCommandKind if kind not in NOT_PLAIN]
waits = st.one_of(st.floats(0.0, 0.06), st.floats(0.0, 3.0))
reaches = st.sampled_from([0.0, 1e-4, 0.003, 0.02, 0.1, 0.4, 1.0])
EXPLORED = st.one_of(
    st.builds(planned, shares, reaches, st.sampled_from([0.0, 0.0, 0.0, 0.5, 3.0]), st.sampled_from([0.0, -1.0, 0.3])),
    st.builds(following, shares, reaches),
    st.builds(corners, shares, reaches, st.integers(1, 6), st.sampled_from([0.02, 0.5, 1.5])),
    st.builds(
        lambda share, reach, time, rests: lambda play: play.goal(point(near(play, share, reach), time, rests)),
        shares, reaches, st.sampled_from([0.0, 0.001, 0.5, 4.0, 8.0]), st.booleans(),
    ),
    st.builds(lambda rests: lambda play: play.goal(point(play.here(), 0.0, rests)), st.booleans()),
    st.builds(
        lambda back: lambda play: play.rig.handle(CancelInput(f"g{max(0, len(play.accepted) - back)}")),
        st.integers(1, 2),
    ),
    st.builds(stream, shares, reaches, st.integers(1, 12), st.sampled_from([0.02, 0.1, 0.4])),
    st.builds(lambda kind: lambda play: play.command(kind), st.sampled_from(PLAIN)),
    st.builds(
        lambda speed: lambda play: play.command(DeviceCommandKind.SPEED, speed), st.sampled_from([0.0, 0.1, 0.6, 1.0])
    ),
    st.builds(lambda seconds: lambda play: play.home(seconds), st.sampled_from([0.3, 3.0, 40.0])),
    st.builds(lambda seconds: lambda play: play.press_estop(seconds), st.sampled_from([0.001, 0.5])),
    st.builds(lambda kind: lambda play: play.command(kind), st.sampled_from(PAUSES)),
    st.builds(link, st.floats(0.02, 2.0), st.booleans()),
    st.builds(freeze, st.floats(0.02, 1.5)),
    st.just(restart),
    st.builds(lambda referenced: lambda play: play.reboot(referenced), st.booleans()),
)  # fmt: skip
wires = st.builds(
    VirtualWire,
    delay=st.sampled_from([0.001, 0.02]),
    jitter=st.sampled_from([0.0, 0.01, 0.06]),
    loss=st.sampled_from([0.0, 0.1]),
    duplicates=st.sampled_from([0.0, 0.2]),
)


def settle(play: Play) -> None:
    """Everything is quiet; every goal ends; a person does what the refusals ask for."""
    rig = play.rig
    rig.wire.loss = rig.wire.jitter = rig.wire.duplicates = 0.0
    rig.run(0.3)
    play.command(DeviceCommandKind.SPEED, 1.0)
    if rig.device.mode == DeviceMode.HOLD:
        rig.run(3.0)
    if rig.device.mode == DeviceMode.HOLD:
        play.command(DeviceCommandKind.RESUME)
    open_goals = [g for g, since in play.accepted.items() if since != float("inf") and g not in rig.finished]
    rig.run(PATIENCE, lambda: all(g in rig.finished for g in open_goals))
    play.check()
    assert all(g in rig.finished for g in open_goals)
    rig.run(4.0)
    play.check()
    play.finish_track()
    if rig.device.mode == DeviceMode.UNREFERENCED:
        play.revive()
        assert rig.answers[play.tickets].accepted, rig.answers[play.tickets].reason
        play.quiet_since = len(rig.path)
    assert rig.device.mode == DeviceMode.IDLE


def assert_next_goal_succeeds(play: Play) -> None:
    rig = play.rig
    assert not rig.core.not_ready(rig.moment)
    verdict = rig.goal(move(play.here(), (0.1, -0.1, 0.05)), "next")
    assert verdict.accepted, verdict.reason
    status, result = rig.finish("next", 25.0)
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert result.executed_steps == result.commanded_steps == rig.device.steps
    play.check()
    play.finish_track()


@examples(quick=8, full=30)
@given(wires, st.integers(0, 99), st.lists(st.tuples(EXPLORED, waits), min_size=3, max_size=10))
def test_whatever_the_sequence_the_arm_stays_safe_and_every_goal_ends(
    wire: VirtualWire, seed: int, sequence: list[tuple[Action, float]]
) -> None:
    play = Play(wire, seed)
    for act, wait in sequence:
        act(play)
        play.wait(wait)
    settle(play)
    assert_next_goal_succeeds(play)


def test_a_path_that_is_judged_from_within_a_motion_is_judged_as_it_was() -> None:
    play = Play(VirtualWire(), seed=0)
    for act, wait in ((stream((0.0, 0.0, 0.0), 0.1, 7, 0.02), 0.03), (planned((0.0, 0.0, 0.0), 0.0, 0.0, 0.0), 0.05)):
        act(play)
        play.wait(wait)
    assert play.rig.device.moving
    play.quiet_since = len(play.rig.path)
    play.rig.run(4.0)
    play.finish_track()
