"""Figures of motions of the tool: straight lines planned whole, and jogging step by step."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, LinearMotion, PlanCode, PlanRequest, PoseGoal
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.jog.jog import PERIOD, Jog
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.timing.profile import joint_limits
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples, quantile
from gemelo.tools.bench.planner.path_quality import least_time
from gemelo.tools.bench.scenes import CHECK_SCENE, parol6, rm1

Array = NDArray[np.float64]

PROBLEMS = 200  # lines an arm
SEED = 5
LONGEST = 0.2  # [m]
COMFORT = 0.2  # share of the joints' travel at both ends in which no line begins
WARMING = 5


def lin_ms() -> Figure:
    """Time of one straight tool line [ms], from request to verified trajectory, in the planner's core."""
    samples: list[float] = []
    reference: dict[str, float] = {}
    whole: list[str] = []
    for arm in (rm1(), parol6()):
        took, fractions = lines(arm)
        samples += took
        reference[f"{arm.name} median"] = quantile(took, 0.5)
        reference[f"{arm.name} p99"] = quantile(took, 0.99)
        line = PlainLines(arm)
        plain = [line.solving_ms(request) for request in line_requests(arm, Planner(arm))][WARMING:]
        reference[f"{arm.name}, plain way, median"] = quantile(plain, 0.5)
        reference[f"{arm.name}, plain way, p99"] = quantile(plain, 0.99)
        whole.append(f"{arm.name} {sum(fraction == 1.0 for fraction in fractions)} whole")
    note = (
        f"{PROBLEMS} random lines an arm of up to {LONGEST} m (seed {SEED}), no obstacles but the arm itself; "
        f"{', '.join(whole)}, the others go as far as a limit, a singularity or a contact allows, and count; the "
        "plain way is a configuration every 5 mm and toppra, neither checked in between nor verified"
    )
    return of_samples(samples, reference=reference, note=note)


def lines(arm: ArmDescription) -> tuple[list[float], list[float]]:
    """Times [ms] of the plans and the planned fractions of their lines, 0 for a refused one."""
    planner = Planner(arm)
    took: list[float] = []
    fractions: list[float] = []
    for index, request in enumerate(line_requests(arm, planner)):
        began = time.perf_counter()
        answer = planner.plan(request, None)
        if index >= WARMING:
            took.append((time.perf_counter() - began) * 1e3)
            fractions.append(answer.fraction if answer.code is PlanCode.SUCCESS else 0.0)
    return took, fractions


def line_requests(arm: ArmDescription, planner: Planner) -> list[PlanRequest]:
    """Lines of random starts and directions; the same ones in every run."""
    random = np.random.default_rng(SEED)
    lower = np.array([joint.lower for joint in arm.joints])
    travel = np.array([joint.upper for joint in arm.joints]) - lower
    requests: list[PlanRequest] = []
    while len(requests) < PROBLEMS + WARMING:
        start = lower + random.uniform(COMFORT, 1.0 - COMFORT, len(lower)) * travel
        offset = random.normal(size=3)
        offset *= random.uniform(0.01, LONGEST) / np.linalg.norm(offset)
        if planner.kinematics.self_collisions(start, 0.01):
            continue
        goal = planner.kinematics.tool(start).position + offset
        standing = JointState(name=arm.joint_names, position=tuple(start.tolist()))
        motion = LinearMotion(least_fraction=0.0)
        requests.append(PlanRequest(goal=PoseGoal(position=tuple(goal.tolist())), start=standing, motion=motion))
    return requests


STEP = 0.005  # [m] between two poses
JUMP = 0.5  # [rad], [m] that no joint may move between them
FULL = 6  # joints with which the tool keeps its orientation


class PlainLines:
    """The reference: poses on the line, the nearest IK solution for each, a spline through them timed by toppra.

    As MoveIt's `computeCartesianPath` and its time-optimal parametrisation: nothing is checked between the poses, the
    result is not verified, and its jerk is not limited. For one arm without a scene.
    """

    def __init__(self, arm: ArmDescription) -> None:
        self._kinematics = Kinematics(arm)
        self._world = World(arm, self._kinematics)
        self._solver = InverseKinematics(arm, self._kinematics)
        self._limits = joint_limits(arm)
        self._is_full = len(arm.joints) >= FULL

    def solving_ms(self, request: PlanRequest) -> float:
        """Time [ms] for a request with a start and a tool position in the base frame, as far as the line goes."""
        began = time.perf_counter()
        rows = self.rows(request)
        if len(rows) > 1:
            least_time(rows, self._limits)
        return (time.perf_counter() - began) * 1e3

    def rows(self, request: PlanRequest) -> Array:
        """Configurations (m, n) [rad] or [m] along the line; raises ValueError without a start or a pose goal."""
        if request.start is None or not isinstance(request.goal, PoseGoal):
            raise ValueError("a plain line is asked for with a start and a tool position")
        rows = [np.array(request.start.position)]
        pose = self._kinematics.tool(rows[0])
        line = np.array(request.goal.position) - pose.position
        for share in np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(line) / STEP))[1:].tolist():
            target = ToolTarget(pose.position + share * line, pose.rotation if self._is_full else None)
            found = next(self._solver.solutions(target, rows[-1], NEVER), None)
            if found is None or np.abs(found - rows[-1]).max() > JUMP or self._world.distance(found) <= 0.0:
                break
            rows.append(found)
        return np.array(rows)


JOG_COMMANDS, JOG_STEPS = 40, 25  # each command is held for half a second
JOG_SPEED = 0.15  # [m/s]
# [us] a quarter of the period: a late step slows the arm, and other processes need the core too.
JOG_GOAL = FigureGoal(p99=0.25 * PERIOD * 1e6)


def jog_tick_us() -> Figure:
    """CPU time of one jog step [us], of the 20 ms that it has: tool twists among obstacles and joint limits."""
    reference = {
        "parol6, no scene": quantile(jog_ticks(parol6(), PlanningScene()), 0.5),
        "rm1, same scene": quantile(jog_ticks(rm1(), CHECK_SCENE), 0.5),
    }
    note = (
        f"parol6, {len(CHECK_SCENE.objects)} boxes, {JOG_COMMANDS} random twists of up to {JOG_SPEED:g} m/s, "
        f"{JOG_STEPS} steps each, CPU time"
    )
    return of_samples(jog_ticks(parol6(), CHECK_SCENE), JOG_GOAL, reference, note)


def jog_ticks(arm: ArmDescription, scene: PlanningScene) -> list[float]:
    """CPU time [us] of every step; the arm follows at once."""
    kinematics = Kinematics(arm)
    jog = Jog(arm, kinematics, World(arm, kinematics, scene))
    rng = np.random.default_rng(1)
    state = JointState(name=arm.joint_names, position=arm.named_states["ready"])
    samples: list[float] = []
    for index in range(JOG_COMMANDS * JOG_STEPS):
        if index % JOG_STEPS == 0:
            command = JogCommand(linear=tuple(rng.uniform(-JOG_SPEED, JOG_SPEED, 3).tolist()))
        jog.on_command(command, index * PERIOD)
        started = time.thread_time()
        jog.step(index * PERIOD, 0, state, 0.0, goal_is_active=False)
        samples.append((time.thread_time() - started) * 1e6)
        if jog.commanded is not None:
            state = JointState(name=arm.joint_names, position=tuple(jog.commanded[0].tolist()))
    return samples
