"""Joint values for a full tool pose, the nearest first: parol6 in closed form, against searching for them."""

from __future__ import annotations

from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile
from services.bench.poses import problems, solving_ms
from services.planner.kinematics.ik import InverseKinematics

UNIT = "ms"
GOAL = Goal(median=0.2, p99=1.0)
POSES, SEARCHED, TRIES = 2000, 200, 3


def measure() -> Figure:
    """parol6's figure; the references are of the first of the same poses, in the same run."""
    arm = parol6()
    kinematics = Kinematics(arm)
    solver = InverseKinematics(arm, kinematics)
    if not solver.is_closed_form:
        raise NotMeasured("EAIK could not be imported")
    asked = problems(arm, kinematics, POSES, is_full=True)
    searched = solving_ms(InverseKinematics(arm, kinematics, is_numeric=True), asked[:SEARCHED], TRIES)
    short = rm1()
    short_kinematics = Kinematics(short)
    positions = problems(short, short_kinematics, SEARCHED, is_full=False)
    short_ms = solving_ms(InverseKinematics(short, short_kinematics), positions, TRIES)
    reference = {
        "parol6, searched, median": quantile(searched, 0.5),
        "parol6, searched, p99": quantile(searched, 0.99),
        "rm1, position, searched, median": quantile(short_ms, 0.5),
        "rm1, position, searched, p99": quantile(short_ms, 0.99),
    }
    note = f"{POSES} random reachable poses, each from a random posture, the fastest of {TRIES} runs of each"
    return of_samples(solving_ms(solver, asked, TRIES), UNIT, GOAL, reference, note)
