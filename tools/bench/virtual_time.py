"""Figures of the gateway's core and the firmware's core together in virtual time: chunks lost, hold, clock error."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import CommandAck, CommandChunk, DeviceMode
from gemelo.schemas.message import Message
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.virtual_arm.virtual_arm import PERIOD, VirtualArm, tcp_wire

CHUNKS = 45_000
SECONDS = 60.0  # of one goal; one after another until all chunks are sent
SWING, POINT = 6.0, 0.1  # [s] of the swing, [s] between points
SPEED_SHARE = 0.5  # of the limits


class Tally:
    """Counts chunks sent, acknowledged and refused."""

    def __init__(self) -> None:
        self.sent: set[tuple[int, int]] = set()
        self.acknowledged: set[tuple[int, int]] = set()
        self.refused = 0
        self.last: tuple[int, ...] = ()  # [1/256 step] of the last knot sent

    def on_message(self, message: Message) -> None:
        """Takes every message of the gateway."""
        match message:
            case CommandChunk():
                self.sent.add((message.stream, message.seq))
                self.last = message.steps[-1]
            case CommandAck() if message.code in (0, 1):
                self.acknowledged.add((message.stream, message.seq))
            case CommandAck():
                self.refused += 1


def lost_of_45000_at_25hz() -> Figure:
    """Chunks lost of 45,000 at 25 Hz: half an hour of motion. Lost is a chunk that was never acknowledged.

    The wire delays and delivers in order, as TCP does. The step counts are compared as well.
    """
    arm, tally = rm1(), Tally()
    world = VirtualArm(tcp_wire(), arm=arm, on_message=tally.on_message, step_us=PERIOD)
    world.run(1.0)
    trajectory = swinging(arm, SECONDS)
    goals = 0
    while len(tally.sent) < CHUNKS:
        goals += 1
        goal = FollowJointTrajectoryGoal(trajectory=trajectory)
        verdict = world.goal(goal, f"goal-{goals}")
        if not verdict.accepted:
            raise NotMeasured(f"goal {goals} was refused: {verdict.reason}")
        world.run(SECONDS + 1.0)
    missing = [abs(((q8 + 128) >> 8) - made) for q8, made in zip(tally.last, world.device.steps, strict=True)]
    lost = len(tally.sent - tally.acknowledged)
    note = (
        f"virtual time: {world.now:.0f} s, {len(tally.sent)} chunks in {goals} goals, {tally.refused} refused "
        f"and sent again, a wire of 1 to 8 ms; {sum(missing)} steps missing at the "
        f"end, largest |commanded - executed| at any slot end {world.device.max_slot_error / 256:.3f} steps"
    )
    return Figure(
        median=float(lost), p99=float(lost), goal="0 lost, 0 steps missing", met=lost + sum(missing) == 0,
        reference={"seed: mean round trip at 12.5 Hz [ms]": 29.8}, note=note,
    )  # fmt: skip


def swinging(arm: ArmDescription, seconds: float) -> JointTrajectory:
    """All joints from zero to twice their amplitudes and back to zero, again and again for `seconds` [s], at rest at
    both ends; points with velocities."""
    amplitudes = [amplitude_of(arm, index) for index in range(len(arm.joints))]
    rate = math.tau / SWING
    points = []
    for index in range(round(seconds / POINT) + 1):
        time = index * POINT
        points.append(
            TrajectoryPoint(
                positions=tuple(a * (1.0 - math.cos(rate * time)) for a in amplitudes),
                velocities=tuple(a * rate * math.sin(rate * time) if 0.0 < time < seconds else 0.0 for a in amplitudes),
                time_from_start=time,
            )
        )
    return JointTrajectory(joint_names=arm.joint_names, points=tuple(points))


def amplitude_of(arm: ArmDescription, index: int) -> float:
    """Amplitude [rad] or [m] at half of the joint's limits."""
    joint, rate = arm.joints[index], math.tau / SWING
    fastest = SPEED_SHARE * min(joint.velocity / rate, joint.acceleration / rate**2)
    return min(fastest, 0.45 * joint.upper)


TRIES = 25
HOLD_GOAL = FigureGoal(p99=502.0)  # [ms] hold_timeout_ms of the configuration and two slots
FIRST, LATER = 1.5, 0.037  # [s] into the move at which the loop hangs; later with each try
SLOT = 0.001  # [s] between two checks
LONGEST = 4.0  # [s]


def hold_reaction_ms() -> Figure:
    """Time [ms] from the last heartbeat that the device receives until it slows down."""
    reactions, stops = zip(*(reaction(FIRST + LATER * index, index) for index in range(TRIES)), strict=True)
    note = (
        f"virtual time, the gateway's loop hangs in the middle of a swing, {TRIES} times; a wire of 1 "
        f"to 8 ms; until it stands: median {quantile(stops, 0.5):.0f} ms"
    )
    return of_samples(reactions, HOLD_GOAL, {"until it stands": max(stops)}, note)


def reaction(silent_at: float, seed: int) -> tuple[float, float]:
    """Times [ms] from the last heartbeat, at `silent_at` [s], until the device slows down, and until it stands."""
    arm = rm1()
    world = VirtualArm(tcp_wire(), seed, arm=arm)
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=swinging(arm, 12.0))
    verdict = world.goal(goal)
    if not verdict.accepted:
        raise NotMeasured(f"the goal was refused: {verdict.reason}")
    world.run(silent_at)
    world.loop_is_on = False
    slowed = until(world, lambda: world.device.mode == DeviceMode.HOLD)
    stood = until(world, lambda: not world.device.moving)
    return (slowed - world.heartbeat_us) * 1e-3, (stood - world.heartbeat_us) * 1e-3


def until(world: VirtualArm, is_so: Callable[[], bool]) -> int:
    """Virtual time [us] at which `is_so` becomes true, to a slot."""
    end = world.now + LONGEST
    while not is_so():
        if world.now > end:
            raise NotMeasured(f"the device went on for {LONGEST:g} s without a heartbeat")
        world.run(SLOT)
    return world.now_us


DRIFT = 100e-6  # of the device's clock
OFFSET = 123_456_789.0  # [us] between the two
EXCHANGE = 500_000  # [us] between two exchanges
SAMPLE = 20_000  # [us] between two samples of the error
SETTLING = 8_000_000  # [us] that is not counted
CLOCK_DURATION = 600_000_000  # [us]
CLOCK_GOAL = FigureGoal(p99=500.0)  # [us] half a slot
CLOCK_SEED = 20_261_121

Delays = tuple[float, float]  # [us] there and back
Network = Callable[[random.Random], Delays]


def quiet(rng: random.Random) -> Delays:
    """A good network: 0.5 to 1.5 ms each way."""
    return rng.uniform(500, 1500), rng.uniform(500, 1500)


def spiky(rng: random.Random) -> Delays:
    """The same, with 5 to 40 ms more with a probability of 10 % each way."""
    there, back = quiet(rng)
    late = [rng.uniform(5_000, 40_000) if rng.random() < 0.1 else 0.0 for _ in range(2)]
    return there + late[0], back + late[1]


def modem_sleep(rng: random.Random) -> Delays:
    """A Wi-Fi station that sleeps between beacons of 102.4 ms receives late and answers at once."""
    return rng.uniform(1_000, 103_400), rng.uniform(1_000, 3_000)


NETWORKS: dict[str, Network] = {"quiet": quiet, "spiky": spiky, "modem sleep": modem_sleep}


def clock_sync_error_us() -> Figure:
    """Error [us] of the gateway's estimate of the device's clock at 100 ppm of drift, two exchanges a second."""
    found = {name: list(clock_errors(network)) for name, network in NETWORKS.items()}
    others = {f"{name} p99": quantile(found[name], 0.99) for name in NETWORKS if name != "spiky"}
    note = "virtual time, 100 ppm, spiky network; the firmware switches Wi-Fi's power saving off"
    return of_samples(found["spiky"], CLOCK_GOAL, others, note)


def clock_errors(network: Network) -> Iterator[float]:
    """|error| [us] of the estimated device time, 50 times a second."""
    clock, rng = ClockSync(), random.Random(CLOCK_SEED)
    now = 0
    while now < CLOCK_DURATION:
        there, back = network(rng)
        t0, t3 = now, now + round(there + back)
        received = round(device_time(now + there))
        clock.add(t0, received, received, t3)
        if now >= SETTLING:
            for at in range(t3, t3 + EXCHANGE, SAMPLE):
                yield abs(clock.device_time(at * 1e-6) - device_time(at))
        now += EXCHANGE


def device_time(ours: float) -> float:
    """The device's clock [us] at the gateway's time `ours` [us]."""
    return ours * (1.0 + DRIFT) + OFFSET
