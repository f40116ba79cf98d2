"""The figure of the gripper, in virtual time: from the accepted goal to the pulse that moves."""

from __future__ import annotations

from functools import partial

from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.bench.virtual_time import until
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, tcp_wire

TRIES = 40
REACTION_GOAL = FigureGoal(p99=10.0)  # [ms] the slowest frame of the wire, 8 ms, and two slots
PAUSE = 0.0013  # [s] by which each try is later in the gateway's turn
WAYS = (0.0, 0.05)  # [m] closed and open


def gripper_reaction_ms() -> Figure:
    """Time [ms] from an accepted goal of the gripper until the servo's pulse changes."""
    arm = rm1()
    world = VirtualArm(tcp_wire(), arm=arm)
    world.run(1.0)
    _go(world, WAYS[1])
    _finish(world)
    reactions, whole = [], []
    for index in range(TRIES):
        world.run(0.1 + index * PAUSE)
        begun, before = world.now_us, world.device.servo_us
        _go(world, WAYS[index % 2])
        moved = until(world, partial(_has_left, world, before))
        reactions.append((moved - begun) * 1e-3)
        _finish(world)
        whole.append((world.now_us - begun) * 1e-3)
    note = f"virtual time, rm1's servo over 50 mm at 0.1 m/s, {TRIES} goals, a wire of 1 to 8 ms"
    return of_samples(reactions, REACTION_GOAL, {"until the result, median": quantile(whole, 0.5)}, note)


def _has_left(world: VirtualArm, pulse_us: int) -> bool:
    return world.device.servo_us != pulse_us


def _go(world: VirtualArm, position: float) -> None:
    verdict = world.grip(position)
    if not verdict.accepted:
        raise NotMeasured(f"the goal was refused: {verdict.reason}")


def _finish(world: VirtualArm) -> None:
    _, result = world.finish_grip()
    if not result.reached_goal:
        raise NotMeasured(f"the gripper did not arrive: {result.error_string or 'it stalled'}")
