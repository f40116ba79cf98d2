"""The end of `gemelo check`: random configurations of a robot, and plans between the free ones.

`python -m gemelo.services.planner.trial ROBOT_FOLDER` prints its findings as JSON, one a line; none if plans succeed.
"""

from __future__ import annotations

import logging
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, pairwise
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.kinematics.self_collisions import LinkPair
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.reasons import Reason, because, plain, remedy
from gemelo.services.planner.core import Planner
from gemelo.services.planner.native import assembly
from gemelo.services.planner.request.deadline import Deadline

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
CONFIGURATIONS = 300  # chosen: a share of 1 % is seen with so many
PLANS = 30  # chosen: what fits into SECONDS on a small computer
SEED = 0  # chosen: the same trial each time
MOST_TURNED = 3  # joints, one after the other; chosen: each adds configurations to try
TURN = 2.0 * np.pi  # [rad]
SECONDS = 4.0  # for all of it, once the planner is ready: what has not begun by then is left out
ALLOWED = 2.0  # [s] for one plan; chosen: the usual ones take a hundredth of it
FEWEST = 5  # plans that are tried however long they take, and that must all fail for the robot to be called unfit
LEAST_FREE = 0.01  # share of the configurations: with less, plans have nowhere to go
OFTEN = 0.5  # of how often the most frequent pair is near: rarer ones are not named
MOST_NAMED = 3  # findings about pairs, and about plans; chosen: what a person reads


def trial(arm: ArmDescription, seconds: float = SECONDS) -> list[Finding]:
    """What keeps plans from succeeding within `seconds` [s], by name; empty where they do."""
    planner = Planner(arm)
    planner.prepare()
    deadline = Deadline(time.monotonic, seconds, time.monotonic())
    findings = [*_large_models(planner), *_named_states(planner)]
    free, near, count = _sampled(planner, deadline)
    if len(free) < max(2, LEAST_FREE * count):
        return [*findings, *_nowhere_free(arm, near, count)]
    return [*findings, *_plans(planner, free, deadline)]


def _large_models(planner: Planner) -> Iterator[Finding]:
    """Of links whose spheres reach far beyond their shapes."""
    core, file = planner.checker.native(planner.arm.clearance), planner.arm.urdf_path.name
    for link, why in core.large_links.items() if core else ():
        yield warning(file, Subject("link", link), why)


def _named_states(planner: Planner) -> Iterator[Finding]:
    """Of the states of the SRDF that do not keep the clearance, the nearest pair."""
    world, arm = planner.checker.world, planner.arm
    for name, state in arm.named_states.items():
        contacts = world.contacts(state, arm.clearance)
        if contacts:
            nearest = contacts[0]
            would_do = remedy("move_state"), remedy("correct_shapes"), remedy("smaller_clearance_in_file")
            figures = {"distance": nearest.distance, "clearance": arm.clearance}
            why = because("trial.state.near", *would_do, first=nearest.first, second=nearest.second, **figures)
            yield warning(arm.srdf_path.name, Subject("state", name), why)


def _sampled(planner: Planner, deadline: Deadline) -> tuple[list[Array], dict[LinkPair, list[float]], int]:
    """The free configurations (n,) among random ones; of the others each near pair with its distances [m]; how many
    there were."""
    world, arm, random = planner.checker.world, planner.arm, np.random.default_rng(SEED)
    free: list[Array] = []
    near: dict[LinkPair, list[float]] = {}
    count, half = 0, deadline.share(0.5)
    while count < CONFIGURATIONS and not (count > 1 and half.has_passed()):
        configuration = _drawn(arm, random)
        count += 1
        if planner.checker.keeps(configuration, arm.clearance):
            free.append(configuration)
            continue
        for contact in world.contacts(configuration, arm.clearance):
            near.setdefault((contact.first, contact.second), []).append(contact.distance)
    return free, near, count


def _drawn(arm: ArmDescription, random: np.random.Generator) -> Array:
    """(n,) [rad] or [m], uniform within the limits; a whole turn where there are none."""
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    bounds = np.where(np.isfinite(lower), lower, -np.pi), np.where(np.isfinite(upper), upper, np.pi)
    return random.uniform(*bounds)


def _nowhere_free(arm: ArmDescription, near: dict[LinkPair, list[float]], count: int) -> list[Finding]:
    """The pairs that are in the way most often, with how near they come."""
    most = sorted(near.items(), key=lambda item: -len(item[1]))
    most = [item for item in most if len(item[1]) > OFTEN * len(most[0][1])][:MOST_NAMED]
    would_do = remedy("excuse_pairs", folder=str(arm.folder)), remedy("correct_shapes")

    def why(distances: Sequence[float]) -> Reason:
        figures = {"clearance": arm.clearance, "nearest": min(distances), "farthest": max(distances)}
        return because("trial.pair.near", *would_do, times=len(distances), count=count, **figures)

    file = arm.srdf_path.name
    return [error(file, Subject("pair", f"{first} / {second}"), why(distances)) for (first, second), distances in most]


def _plans(planner: Planner, free: list[Array], deadline: Deadline) -> Iterator[Finding]:
    """One finding for each reason that plans between free configurations fail for, the most frequent first.

    They are errors where every plan fails: two free configurations need not have a path between them.
    """
    failed: Counter[str] = Counter()
    reasons: dict[str, Reason] = {}
    tried = 0
    for start, goal in list(pairwise(free))[:PLANS]:
        if tried >= FEWEST and deadline.has_passed():
            break
        tried += 1
        response = _planned(planner, start, goal)
        if response.code is not PlanCode.SUCCESS and response.refusal is not None:
            failed[response.refusal.subject] += 1
            reasons.setdefault(response.refusal.subject, response.refusal.why or plain(response.refusal.message))
    severe = error if sum(failed.values()) == tried >= FEWEST else warning
    for subject, times in failed.most_common(MOST_NAMED):
        would_do = () if severe is error else (remedy("may_be_unconnected"),)
        why = because("trial.plans.fail", reasons[subject], *would_do, times=times, tried=tried)
        yield severe(planner.arm.urdf_path.name, Subject("plans", subject), why)


def looking_the_same(arm: ArmDescription, start: Array, goal: Array) -> Iterator[Array]:
    """(n,) configurations within the limits that look as `goal`: each joint within half a turn of `start` [rad], then
    one joint after the other from the base on turned the other way round.

    A shoulder that may turn twice can often reach a place on one side of its base only.
    """
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    may_turn = np.array([arm.model.joint(name).kind is not JointKind.PRISMATIC for name in arm.joint_names])

    def inside(wanted: Array, otherwise: Array) -> Array:
        return np.where(may_turn & (wanted >= lower) & (wanted <= upper), wanted, otherwise)

    nearest = inside(start + np.mod(goal - start + np.pi, TURN) - np.pi, goal)
    yield nearest
    others = inside(nearest - TURN * np.sign(nearest - start), nearest)
    for joint in np.flatnonzero(others != nearest)[:MOST_TURNED]:
        yield np.where(np.arange(len(goal)) == joint, others, nearest)


def _planned(planner: Planner, start: Array, goal: Array) -> PlanResponse:
    """The first plan to `goal` [rad] or [m], or to what looks the same, that succeeds; else the first refusal."""
    responses = (_planned_to(planner, start, each) for each in looking_the_same(planner.arm, start, goal))
    first = next(responses)
    return next((each for each in chain((first,), responses) if each.code is PlanCode.SUCCESS), first)


def _planned_to(planner: Planner, start: Array, goal: Array) -> PlanResponse:
    names = planner.arm.joint_names
    request = PlanRequest(
        start=JointState(name=names, position=tuple(start.tolist())),
        goal=JointGoal(name=names, position=tuple(goal.tolist())),
        allowed_time=ALLOWED,
    )
    return planner.plan(request, None, clock=time.monotonic)


def main() -> None:
    """Prints the findings."""
    logging.basicConfig(format="%(message)s", level=logging.INFO)  # to the standard error: how large models are made
    logging.getLogger(assembly.__name__).addFilter(lambda record: record.levelno < logging.WARNING)  # findings say it
    arm = load_arm(Path(sys.argv[1]))
    try:
        found = trial(arm)
    except ValueError as why:  # of an arm that the planner cannot take
        cause = why.reason if isinstance(why, ReasonedError) else plain(str(why))
        found = [error(arm.urdf_path.name, Subject("robot"), because("trial.robot", cause, remedy("join_links")))]
    for finding in found:
        print(msgspec.json.encode(finding).decode())


if __name__ == "__main__":
    main()
