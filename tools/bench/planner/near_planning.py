"""The figure of plans to goals near things: the clearance is asked for, and joint values or a pose."""

from __future__ import annotations

from gemelo.services.planner.core import Planner
from gemelo.tools.bench.any_arm.drawn_problems import DrawnProblem, ProblemDrawer
from gemelo.tools.bench.any_arm.families import FAMILIES
from gemelo.tools.bench.any_arm.generated_arms import ARMS, generated_arm
from gemelo.tools.bench.figures import Figure, NotMeasured, rounded
from gemelo.tools.bench.planner.any_planning import NAMED, REFERENCES, SUCCESS_GOAL, has_contact, planned
from gemelo.tools.bench.planner.trials import spread


def plan_near_success(count: int) -> Figure:
    """Share [%] solved of the problems that any planner solves, of the first `count` of each arm and family, whose
    goals are 0.8 to 4 mm from something, with a clearance of 0.5 mm; a trajectory with a contact is no solution."""
    possible, contacts, failed = 0, 0, []
    worked: dict[bool, list[float]] = {False: [], True: []}
    for arm in ARMS:
        planner = Planner(generated_arm(arm))
        planner.prepare()
        drawer = ProblemDrawer(planner.arm, planner.kinematics)
        for problem in (drawer.near(family, seed) for family in FAMILIES for seed in range(count)):
            response, took, _ = planned(planner, problem)
            is_solved, touches = response.refusal is None, has_contact(planner, problem, response.trajectory)
            if not is_solved and not _is_possible(planner, problem):
                continue
            possible, contacts = possible + 1, contacts + touches
            worked[problem.is_pose].append(took)
            if touches or not is_solved:
                failed.append(f"{arm} {problem.family} {problem.seed}")
    if not possible:
        raise NotMeasured("no planner has solved any problem")
    share = rounded(100.0 * (1.0 - len(failed) / possible))
    reference = {"contacts": float(contacts)}
    for is_pose, what in ((False, "joint values [ms]"), (True, "poses [ms]")):
        reference |= spread(what, worked[is_pose], 0.5, 0.99)
    return Figure(
        median=share,
        p99=share,
        goal=f">= {SUCCESS_GOAL:g}, no contact",
        met=share >= SUCCESS_GOAL and not contacts,
        reference={name: rounded(value) for name, value in reference.items()},
        note=f"{possible} goals 0.8 to 4 mm from something, clearance 0.5 mm; not solved: "
        f"{', '.join(failed[:NAMED]) or 'none'}",
    )


def _is_possible(planner: Planner, problem: DrawnProblem) -> bool:
    """True if any of the others solves it."""
    others = (kind(planner.arm, problem.setting.scene) for kind in REFERENCES.values())
    return any(other.shortened_path(problem.start, problem.goal, problem.seed) is not None for other in others)
