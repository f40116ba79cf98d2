"""From the last heartbeat that the device hears to its first slowing, by both real cores in virtual time."""

from __future__ import annotations

from collections.abc import Callable

from schemas.device import DeviceMode
from schemas.motion import FollowJointTrajectoryGoal
from services.bench.arms import rm1
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile
from services.bench.lost_of_45000_at_25hz import swinging
from services.bench.virtual_arm import DELAY, VirtualArm

UNIT = "ms"
TRIES = 25
GOAL = Goal(p99=502.0)  # the configuration's hold_timeout_ms, and two slots
FIRST, LATER = 1.5, 0.037  # [s] into the move at which the gateway's loop hangs, and by how much later each time
SLOT = 0.001  # [s] between two looks
LONGEST = 4.0  # [s]


def measure() -> Figure:
    reactions, stops = zip(*(reaction(FIRST + LATER * index, index) for index in range(TRIES)), strict=True)
    note = (
        f"virtual time, the gateway's loop hangs in the middle of a swing, {TRIES} times; a wire of {DELAY[0] / 1e3:g} "
        f"to {DELAY[1] / 1e3:g} ms; until it stands: median {quantile(stops, 0.5):.0f} ms"
    )
    return of_samples(reactions, UNIT, GOAL, {"until it stands": max(stops)}, note)


def reaction(silent_at: float, seed: int) -> tuple[float, float]:
    """[ms] from the last heartbeat until the device slows, and until it stands."""
    arm = rm1()
    world = VirtualArm(arm, lambda _: None, seed)
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=swinging(arm, 12.0))
    verdict, outputs = world.gateway.on_goal("swing", goal, world.moment)
    world.carry_out(outputs)
    if not verdict.accepted:
        raise NotMeasured(f"the goal was refused: {verdict.reason}")
    world.run(silent_at)
    slowed = until(world, lambda: world.device.mode == DeviceMode.HOLD)
    stood = until(world, lambda: not world.device.moving)
    return (slowed - world.last_beat) * 1e-3, (stood - world.last_beat) * 1e-3


def until(world: VirtualArm, is_so: Callable[[], bool]) -> int:
    """[us] when it is so, to a slot."""
    end = world.now + round(LONGEST * 1e6)
    while not is_so():
        if world.now > end:
            raise NotMeasured(f"the device went on for {LONGEST:g} s without a heartbeat")
        world.idle(SLOT)
    return world.now
