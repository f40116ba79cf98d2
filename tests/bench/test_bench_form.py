"""The form of out/bench.json, and figures that say why they are missing."""

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from gemelo.tools.bench import main
from gemelo.tools.bench.figures import (
    Figure,
    FigureGoal,
    NotMeasured,
    guarded,
    of_samples,
    quantile,
    report_of,
    text_of,
)
from gemelo.tools.bench.main import FIGURES, function_of
from gemelo.tools.bench.panel import DRAG_GOAL, judged_cpu
from gemelo.tools.bench.stack import Stacks
from tests.table import table

OF_THE_ISSUES = (
    "frame_lookup_us", "state_check_us", "collision_checks_per_s", "ik_ms", "ik_success", "plan_ms",
    "plan_success", "path_length_ratio", "duration_ratio", "plan_python_ms", "plan_any_ms", "plan_any_success",
    "plan_narrow_ms", "plan_near_success", "refusal_ms", "plan_mesh_ms", "import_s", "extra_mb", "client_env_mb",
    "client_import_ms", "fit_excess_mm", "first_plan_s",
    "deadline_overrun_ms", "scene_intake_ms", "lin_ms", "jog_tick_us", "tag_pose_mm", "tag_plane_mm", "tag_flips",
    "box_mm", "image_to_pose_ms", "mount_mm", "mount_images_mm", "mount_touch_mm", "camera_cpu_percent",
    "detector_cpu_percent", "image_to_detection_ms", "pick_mm", "pick_success", "replay_speed",
    "simulate_speed", "simulate_start_ms",
    "stream_lag_ms", "stream_lag_live_ms", "stream_watch_cpu", "lerobot_loop_hz", "lerobot_lag_ms",
    "lost_of_45000_at_25hz", "seed_move_percent", "ra_remainder_steps", "text_link_ms", "clock_sync_error_us",
    "hold_reaction_ms", "stopping_distance", "ledger", "gripper_reaction_ms", "max_step_rate_hz",
    "parse_mb_per_s", "step_time_error_us", "estop_reaction_ticks", "render_ms", "cli_start_ms",
    "import_gemelo_ms", "handshake_ms", "ros_bridge_cpu_percent", "ros_latency_ms",
    "arms_on_one_router", "tick_instructions",
    "slot_instructions", "core_text_bytes", "core_ram_bytes", "device_static_ram",
    "idle_cpu_percent", "moving_cpu_percent", "idle_pss_mb", "state_to_frame_ms", "image_path_ms",
    "move_accept_to_first_step_ms", "program_legs", "stop_ms", "chunk_ack_ms", "chunk_ack_tls_ms",
    "panel_cpu_percent", "panel_lag_ms", "stop_key_ms", "goal_drag_hz", "record_cpu_percent",
    "record_mb_per_hour", "blackbox_ms", "blackbox_cpu_percent", "ready_s", "broker_echo_ms",
)  # fmt: skip


@table("name", OF_THE_ISSUES)
def test_every_figure_of_the_issues_has_a_function_of_its_name(name):
    function = function_of(FIGURES[name])
    assert callable(function)
    assert function.__name__ == name
    assert FIGURES[name].unit
    assert function.__doc__


def test_no_figure_is_measured_that_is_not_listed_here():
    """One that vanishes from the bench fails above only if it was listed."""
    assert set(OF_THE_ISSUES) == set(FIGURES) - {"chunk_ack_ms_embedded"}  # which has the function of chunk_ack_ms


def test_both_brokers_are_measured():
    assert {row.broker for name, row in FIGURES.items() if name.startswith("chunk_ack_ms")} == {"mosquitto", "embedded"}


@pytest.mark.parametrize("name", ["clock_sync_error_us", "frame_lookup_us", "tick_instructions", "stop_ms", "ready_s"])
def test_a_figure_without_planning_loads_no_planning_library(name):
    slow = {"pinocchio", "coal", "ompl", "toppra", "yourdfpy"}
    program = (
        "import sys; from gemelo.tools.bench.main import FIGURES, function_of; "
        f"function_of(FIGURES[{name!r}]); print({slow} & set(sys.modules))"
    )
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "set()"


def test_the_json_has_the_form_of_the_architecture():
    figure = guarded(
        lambda: of_samples([1.0, 2.0, 3.0], FigureGoal(median=2.5, p99=10.0), {"echo": 0.123456}, "three"), "ms"
    )
    report = json.loads(msgspec.json.encode(report_of({"plan_ms": figure}, Path(__file__).parents[2])))
    assert set(report) == {"commit", "machine", "figures"}
    assert report["figures"]["plan_ms"] == {
        "unit": "ms", "median": 2.0, "p99": 3.0, "goal": "median <= 2.5, p99 <= 10", "met": True,
        "reference": {"echo": 0.1235}, "note": "three",
    }  # fmt: skip


def test_a_goal_that_is_not_met_is_said():
    figure = of_samples([1.0, 20.0], FigureGoal(p99=10.0))
    assert figure.met is False
    assert "p99 <= 10  NO" in text_of(report_of({"plan_ms": figure}, Path(__file__).parents[2]))


def test_a_goal_may_be_a_least_median_and_that_of_the_page_s_cpu_is_one_at_rest_and_one_in_motion():
    slow, fast = of_samples([19.9], DRAG_GOAL), of_samples([20.1], DRAG_GOAL)
    assert (slow.met, fast.met, slow.goal) == (False, True, "median >= 20")
    for rest, moving, met in ((4.0, 14.0, True), (6.0, 14.0, False), (4.0, 16.0, False)):
        figure = judged_cpu([rest], [moving], {})
        assert (figure.median, figure.reference, figure.met) == (moving, {"at rest": rest}, met)
        assert figure.goal == "median <= 15, at rest median <= 5"


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
