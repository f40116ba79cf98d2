"""The figures about plans, on a few of the real ones."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from schemas.planning import PlanCode, Refusal
from services.bench import duration_ratio, path_length_ratio, plan_ms, plan_success
from services.bench.arms import parol6
from services.bench.duration_ratio import joints_time
from services.bench.figure import NotMeasured
from services.bench.path_bound import least_time
from services.bench.plan_python_ms import in_python_alone
from services.bench.plan_trials import PHASES, Trial, trials
from services.planner.core import Planner
from services.planner.timing.profile import joint_limits

LIMITS = joint_limits(parol6())


@pytest.fixture(scope="module")
def some() -> dict[str, list[Trial]]:
    planner = Planner(parol6())
    return {f"parol6 {name}": trials(planner, name, 6) for name in ("shelf", "cage")}


@pytest.fixture(autouse=True)
def measured(monkeypatch: pytest.MonkeyPatch, some: dict[str, list[Trial]]) -> None:
    for figure in (plan_ms, plan_success, path_length_ratio, duration_ratio):
        monkeypatch.setattr(figure, "every_trial", lambda: some)


def test_a_trial_is_a_whole_plan(some: dict[str, list[Trial]]):
    for trial in (each for row in some.values() for each in row):
        assert trial.is_solved
        assert trial.path[0].tolist() == list(trial.problem.start)
        assert trial.took >= sum(map(trial.phase, PHASES)) > 0.0


def test_ways_are_not_shorter_than_the_best_known_by_more_than_it_may_be_missed(some: dict[str, list[Trial]]):
    figure = path_length_ratio.measure()
    assert 0.97 < figure.median <= figure.p99
    assert figure.reference["straight lines too, p50"] <= figure.median


def test_no_trajectory_is_faster_than_its_bounds(some: dict[str, list[Trial]]):
    for trial in (each for row in some.values() for each in row):
        assert trial.response.duration > 0.999 * least_time(trial.path, LIMITS)
        assert trial.response.duration > 0.999 * joints_time(trial.path, LIMITS)
    assert duration_ratio.measure().median > 1.0


def test_the_bound_of_a_straight_line_is_the_trapezoid_of_its_slowest_joint():
    start = np.array([joint.lower for joint in parol6().joints])
    goal = start + np.array([1.0, 2.0, 1.0, 0.1, 0.1, 0.1])
    trapezoid = 2.0 / LIMITS.velocity[1] + LIMITS.velocity[1] / LIMITS.acceleration[1]
    rows = start + np.linspace(0.0, 1.0, 30)[:, None] * (goal - start)
    assert least_time(rows, LIMITS) == pytest.approx(trapezoid, rel=5e-3)
    assert joints_time(rows, LIMITS) == pytest.approx(trapezoid + LIMITS.acceleration[1] / LIMITS.jerk[1])


def test_a_problem_that_is_not_solved_is_named_and_counts_in_the_time(
    monkeypatch: pytest.MonkeyPatch, some: dict[str, list[Trial]]
):
    assert plan_success.measure().met
    [first, *rest] = some["parol6 cage"]
    response = msgspec.structs.replace(first.response, code=PlanCode.TIMED_OUT, refusal=Refusal(message="too late"))
    failed = dataclasses.replace(first, took=1000.0, response=response)
    monkeypatch.setattr(plan_success, "every_trial", lambda: {"parol6 cage": [failed, *rest]})
    figure = plan_success.measure()
    assert (figure.met, figure.median) == (False, 83.33)
    assert "parol6 cage 0 (TIMED_OUT)" in figure.note
    monkeypatch.setattr(plan_ms, "every_trial", lambda: {"parol6 cage": [failed, *rest]})
    monkeypatch.setattr(plan_ms, "REFERENCES", ())
    assert plan_ms.measure().p99 == 1000.0


def test_a_reference_that_cannot_be_had_is_said(monkeypatch: pytest.MonkeyPatch):
    def missing(*_: object) -> None:
        raise NotMeasured("no such wheel")

    monkeypatch.setattr(plan_ms, "REFERENCES", (("roboplan", missing),))
    figure = plan_ms.measure()
    assert "roboplan: not measured: no such wheel" in figure.note
    assert not any("roboplan" in name for name in figure.reference)


def test_python_alone_has_no_compiled_core_and_solves_too():
    runs = in_python_alone(count=3)
    assert len(runs) == 2 * 4 * 3
    assert all(run.is_solved for run in runs)
    assert {run.planner_id for run in runs} <= {"straight", "RRTConnect"}
