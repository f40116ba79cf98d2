"""The form of out/bench.json, and figures that say why they are missing."""

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from services.bench import main
from services.bench.figures import Figure, Goal, NotMeasured, guarded, of_samples, quantile, report_of, text_of
from services.bench.main import FIGURES, function_of
from services.bench.stack import Stacks

ISSUE = (
    "chunk_ack_tls_ms",
    "chunk_ack_ms", "state_to_frame_ms", "move_accept_to_first_step_ms", "frame_lookup_us", "plan_ms",
    "stack_idle_cpu_percent", "stack_rss_mb", "cli_start_ms", "lost_of_45000_at_25hz", "ready_s",
    "tick_instructions", "slot_instructions", "core_text_bytes", "core_ram_bytes",
    "max_step_rate_hz", "step_time_error_us", "parse_mb_per_s", "clock_sync_error_us", "hold_reaction_ms",
    "gripper_reaction_ms", "estop_reaction_ticks", "seed_move_percent",
    "ik_ms", "ik_success", "plan_success", "plan_python_ms", "path_length_ratio", "duration_ratio",
    "collision_checks_per_s", "state_check_us", "lin_ms", "jog_tick_us", "ledger", "stopping_distance",
    "arms_on_one_router", "handshake_ms",
    "camera_cpu_percent", "detector_cpu_percent", "image_to_detection_ms", "record_cpu_percent", "record_mb_per_hour",
)  # fmt: skip


@pytest.mark.parametrize("name", ISSUE)
def test_every_figure_of_the_issue_has_a_function_of_its_name(name):
    function = function_of(FIGURES[name])
    assert callable(function)
    assert function.__name__ == name
    assert FIGURES[name].unit
    assert function.__doc__


def test_both_brokers_are_measured():
    assert {row.broker for name, row in FIGURES.items() if name.startswith("chunk_ack_ms")} == {"mosquitto", "amqtt"}


@pytest.mark.parametrize("name", ["clock_sync_error_us", "frame_lookup_us", "tick_instructions", "stop_ms", "ready_s"])
def test_a_figure_without_planning_loads_no_planning_library(name):
    slow = {"pinocchio", "coal", "ompl", "toppra", "yourdfpy"}
    program = (
        "import sys; from services.bench.main import FIGURES, function_of; "
        f"function_of(FIGURES[{name!r}]); print({slow} & set(sys.modules))"
    )
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "set()"


def test_the_json_has_the_form_of_the_architecture():
    figure = guarded(lambda: of_samples([1.0, 2.0, 3.0], Goal(median=2.5, p99=10.0), {"echo": 0.123456}, "three"), "ms")
    report = json.loads(msgspec.json.encode(report_of({"plan_ms": figure}, Path(__file__).parents[2])))
    assert set(report) == {"commit", "machine", "figures"}
    assert report["figures"]["plan_ms"] == {
        "unit": "ms", "median": 2.0, "p99": 3.0, "goal": "median <= 2.5, p99 <= 10", "met": True,
        "reference": {"echo": 0.1235}, "note": "three",
    }  # fmt: skip


def test_a_goal_that_is_not_met_is_said():
    figure = of_samples([1.0, 20.0], Goal(p99=10.0))
    assert figure.met is False
    assert "p99 <= 10  NO" in text_of(report_of({"plan_ms": figure}, Path(__file__).parents[2]))


def test_a_figure_that_cannot_be_measured_says_why():
    def measure() -> Figure:
        raise NotMeasured("mosquitto is not installed")

    figure = guarded(measure, "ms")
    assert (figure.median, figure.met) == (None, None)
    assert figure.note == "not measured: mosquitto is not installed"
    assert "NO FIGURE" in text_of(report_of({"chunk_ack_ms": figure}, Path(__file__).parents[2]))


def test_a_figure_that_breaks_does_not_take_the_others_with_it():
    def measure() -> Figure:
        raise RuntimeError("the stack did not start")

    assert guarded(measure, "s").note == "failed: RuntimeError: the stack did not start"


def test_quantiles_are_samples():
    samples = [float(n) for n in range(1, 101)]
    assert (quantile(samples, 0.5), quantile(samples, 0.99)) == (50.0, 99.0)
    assert quantile([7.0], 0.99) == 7.0


def test_a_figure_that_draws_is_given_how_many_and_by_which_seed(monkeypatch: pytest.MonkeyPatch):
    asked = []
    monkeypatch.setattr(main, "function_of", lambda row: lambda *each: asked.append(each) or of_samples([1.0]))
    for name in ("pick_mm", "plan_any_ms", "plan_ms"):
        main.measured(main.FIGURES[name], Stacks(), 7, 3)
    assert asked == [(7, 3), (7,), ()]
