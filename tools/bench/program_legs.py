"""The figure of a program: the time that the arm stands between two legs, planned ahead and planned afterwards."""

from __future__ import annotations

from bisect import bisect_left
from itertools import pairwise

import gemelo
from gemelo.api.arm import Arm
from gemelo.programs import Go, Point, Program, ProgramRun, Repeat, RunStatus
from gemelo.schemas.device import DeviceState
from gemelo.schemas.topics import DEVICE_STATE
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.stack import Stacks

GOAL = FigureGoal(median=1.0, p99=5.0)  # [ms] it is 0 but for the error of the clock's synchronisation
ROUNDS = 10  # of two legs
REACH = 0.4  # [rad] or [m], of the first joint
LONGEST = 120.0  # [s]


def program_legs(stacks: Stacks) -> Figure:
    """Standing time [ms] between two legs of a program; the reference sends each leg when the last has ended."""
    running = stacks.any_broker()
    arm = gemelo.connect(gemelo.Robot(running.deployment, running.arm))
    try:
        if not all(arm.device.state.referenced):
            arm.reference()
        here = dict.fromkeys(arm.joint_names, 0.0) | arm.states["ready"]
        first = arm.joint_names[0]
        points = {"a": Point(here), "b": Point({**here, first: here[first] + REACH})}
        arm.move(joints=here)
        ahead = _standing(arm, points, is_ahead=True)
        afterwards = _standing(arm, points, is_ahead=False)
    finally:
        arm.close()
    reference = {"planned afterwards, median": quantile(afterwards, 0.5), "the same, worst": max(afterwards)}
    note = f"{len(ahead)} handovers of {2 * ROUNDS} legs, from the device's own clock; worst {max(ahead):.2f} ms"
    return of_samples(ahead, GOAL, reference, note)


def _standing(arm: Arm, points: dict[str, Point], is_ahead: bool) -> list[float]:
    """Times [ms] between the legs there and back."""
    heard: list[DeviceState] = []
    subscription = arm.node.subscribe(DEVICE_STATE, heard.append)
    try:
        durations = _run(arm, points) if is_ahead else _one_by_one(arm, points)
    finally:
        subscription.close()
    return standing_between(heard, durations)


def _run(arm: Arm, points: dict[str, Point]) -> list[float]:
    steps = (Repeat(count=ROUNDS, steps=(Go(point="b"), Go(point="a"))),)
    there, back = (arm.plan(joints=points[to].joints, from_joints=points[at].joints) for at, to in ("ab", "ba"))
    run = ProgramRun(arm, Program("shuttle", steps), points, {})
    run.start()
    if (state := run.wait(LONGEST)).status is not RunStatus.DONE:
        raise NotMeasured(f"the program has ended {state.status}: {state.message}")
    return [there.duration, back.duration] * ROUNDS


def _one_by_one(arm: Arm, points: dict[str, Point]) -> list[float]:
    return [arm.move(joints=points[name].joints).plan.duration for _ in range(ROUNDS) for name in "ba"]


def standing_between(states: list[DeviceState], durations: list[float]) -> list[float]:
    """Times [ms] that the device played nothing between the middles of successive legs of `durations` [s]."""
    played = _played(states)
    times = [time for time, _ in played]
    middles, before = [], 0.0
    for duration in durations:
        middles.append(before + duration / 2.0)
        before += duration
    found = []
    for one, other in pairwise(middles):
        first, last = bisect_left(times, one), bisect_left(times, other)
        if last >= len(played):
            raise NotMeasured("not all legs were played")
        passed = (played[last][1] - played[first][1]) * 1e-9
        found.append((passed - (times[last] - times[first])) * 1e3)
    return found


def _played(states: list[DeviceState]) -> list[tuple[float, int]]:
    """(time [s] of path that was played so far, stamp [ns]) of every state in which the device moved."""
    found: list[tuple[float, int]] = []
    ended, stream, newest = 0.0, None, 0.0
    for state in states:
        if stream is None:
            stream, ended = state.stream, -state.play_time  # what it has played before does not count
        elif state.stream != stream:
            ended, stream = ended + newest, state.stream
        newest = state.play_time
        if not found or ended + newest > found[-1][0]:
            found.append((ended + newest, state.stamp))
    return found
