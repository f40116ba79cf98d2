"""The figures about plans, on a few of the real ones."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from gemelo.schemas.planning import PlanCode, Refusal
from gemelo.services.planner.core import Planner
from gemelo.services.planner.timing.profile import joint_limits
from gemelo.tools.bench.figures import NotMeasured
from gemelo.tools.bench.planner import path_quality, planning
from gemelo.tools.bench.planner.path_quality import joints_time, least_time
from gemelo.tools.bench.planner.planning import runs_without_core
from gemelo.tools.bench.planner.trials import PHASES, Trial, trials
from gemelo.tools.bench.scenes import parol6

LIMITS = joint_limits(parol6())


@pytest.fixture(scope="module")
def some() -> dict[str, list[Trial]]:
    planner = Planner(parol6())
    return {f"parol6 {name}": trials(planner, name, 6) for name in ("shelf", "cage")}


@pytest.fixture(autouse=True)
def measured(monkeypatch: pytest.MonkeyPatch, some: dict[str, list[Trial]]) -> None:
    for module in (planning, path_quality):
        monkeypatch.setattr(module, "every_trial", lambda: some)


def test_a_trial_is_a_whole_plan(some: dict[str, list[Trial]]):
    for trial in (each for row in some.values() for each in row):
        assert trial.is_solved
        assert trial.path[0].tolist() == list(trial.problem.start)
        assert trial.took >= sum(map(trial.phase, PHASES)) > 0.0


def test_paths_are_not_shorter_than_the_best_known_by_more_than_it_may_be_missed(some: dict[str, list[Trial]]):
    figure = path_quality.path_length_ratio()
    assert 0.97 < figure.median <= figure.p99
    assert figure.reference["straight lines too, p50"] <= figure.median


def test_no_trajectory_is_faster_than_its_bounds(some: dict[str, list[Trial]]):
    for trial in (each for row in some.values() for each in row):
        assert trial.response.duration > 0.999 * least_time(trial.path, LIMITS)
        assert trial.response.duration > 0.999 * joints_time(trial.path, LIMITS)
    assert path_quality.duration_ratio().median > 1.0


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
    assert planning.plan_success().met
    [first, *rest] = some["parol6 cage"]
    response = msgspec.structs.replace(first.response, code=PlanCode.TIMED_OUT, refusal=Refusal(message="too late"))
    failed = dataclasses.replace(first, took=1000.0, response=response)
    monkeypatch.setattr(planning, "every_trial", lambda: {"parol6 cage": [failed, *rest]})
    figure = planning.plan_success()
    assert (figure.met, figure.median) == (False, 83.33)
    assert "parol6 cage 0 (TIMED_OUT)" in figure.note
    monkeypatch.setattr(planning, "every_trial", lambda: {"parol6 cage": [failed, *rest]})
    monkeypatch.setattr(planning, "REFERENCES", ())
    assert planning.plan_ms().p99 == 1000.0


def test_a_reference_that_cannot_be_had_is_said(monkeypatch: pytest.MonkeyPatch):
    def missing(*_: object) -> None:
        raise NotMeasured("no such wheel")

    monkeypatch.setattr(planning, "REFERENCES", (("roboplan", missing),))
    figure = planning.plan_ms()
    assert "roboplan: not measured: no such wheel" in figure.note
    assert not any("roboplan" in name for name in figure.reference)


def test_python_alone_has_no_compiled_core_and_solves_too():
    runs = runs_without_core(count=3, allowed=20.0)
    assert len(runs) == 2 * 4 * 3
    assert all(run.is_solved for run in runs)
    assert {run.planner_id for run in runs} <= {"straight", "RRTConnect"}
