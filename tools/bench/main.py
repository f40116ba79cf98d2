"""`make bench`: measures every figure here and now; writes out/bench.json and prints a table.

A figure that cannot be measured says why; nothing is estimated. The exit code is 1 if a figure is missing; a goal that
is not met is reported and is no error.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec

from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.process.ending import ended_by_signals
from gemelo.tools.bench.figures import Figure, guarded, report_of, text_of
from gemelo.tools.bench.stack import Stacks


class FigureRow(NamedTuple):
    """One figure."""

    function: str  # module:function of gemelo.tools.bench
    unit: str
    on_a_stack: bool = False
    broker: str = ""  # of that stack, if the figure depends on it
    takes_count: bool = False  # of the problems of each arm and family, as --problems says
    takes_seed: bool = False  # by which they are drawn, as --seed says


SEED = 1
FEW = 4  # problems of each arm and family, where nobody asks for more
# In the order of measuring: first those that a running stack would disturb.
FIGURES = {
    "frame_lookup_us": FigureRow("frames:frame_lookup_us", "us"),
    "state_check_us": FigureRow("planner.collision:state_check_us", "us"),
    "collision_checks_per_s": FigureRow("planner.collision:collision_checks_per_s", "1/s"),
    "ik_ms": FigureRow("planner.kinematics:ik_ms", "ms"),
    "ik_success": FigureRow("planner.kinematics:ik_success", "%"),
    "plan_ms": FigureRow("planner.planning:plan_ms", "ms"),
    "plan_success": FigureRow("planner.planning:plan_success", "%"),
    "path_length_ratio": FigureRow("planner.path_quality:path_length_ratio", "ratio"),
    "duration_ratio": FigureRow("planner.path_quality:duration_ratio", "ratio"),
    "plan_python_ms": FigureRow("planner.planning:plan_python_ms", "ms"),
    "plan_any_ms": FigureRow("planner.any_planning:plan_any_ms", "ms", takes_count=True),
    "plan_any_success": FigureRow("planner.any_planning:plan_any_success", "%", takes_count=True),
    "plan_narrow_ms": FigureRow("planner.narrow_planning:plan_narrow_ms", "ms", takes_count=True),
    "plan_near_success": FigureRow("planner.near_planning:plan_near_success", "%", takes_count=True),
    "refusal_ms": FigureRow("planner.refusing:refusal_ms", "ms", takes_count=True),
    "plan_mesh_ms": FigureRow("planner.mesh_planning:plan_mesh_ms", "ms"),
    "import_s": FigureRow("fit_quality:import_s", "s"),
    "extra_mb": FigureRow("extra_sizes:extra_mb", "MB"),
    "client_env_mb": FigureRow("client:client_env_mb", "MB"),
    "client_import_ms": FigureRow("client:client_import_ms", "ms"),
    "fit_excess_mm": FigureRow("fit_quality:fit_excess_mm", "mm"),
    "first_plan_s": FigureRow("planner.mesh_planning:first_plan_s", "s"),
    "deadline_overrun_ms": FigureRow("planner.deadlines:deadline_overrun_ms", "ms"),
    "scene_intake_ms": FigureRow("planner.scene_intake:scene_intake_ms", "ms"),
    "lin_ms": FigureRow("planner.tool_motion:lin_ms", "ms"),
    "jog_tick_us": FigureRow("planner.tool_motion:jog_tick_us", "us"),
    "tag_pose_mm": FigureRow("vision.figures:tag_pose_mm", "mm"),
    "tag_plane_mm": FigureRow("vision.figures:tag_plane_mm", "mm"),
    "tag_flips": FigureRow("vision.figures:tag_flips", "of 1000"),
    "box_mm": FigureRow("vision.figures:box_mm", "mm"),
    "image_to_pose_ms": FigureRow("vision.figures:image_to_pose_ms", "ms"),
    "mount_mm": FigureRow("vision.figures:mount_mm", "mm"),
    "mount_images_mm": FigureRow("vision.figures:mount_images_mm", "mm"),
    "mount_touch_mm": FigureRow("vision.touching:mount_touch_mm", "mm"),
    "camera_cpu_percent": FigureRow("vision.eyes:camera_cpu_percent", "% of one core"),
    "detector_cpu_percent": FigureRow("vision.eyes:detector_cpu_percent", "% of one core"),
    "image_to_detection_ms": FigureRow("vision.eyes:image_to_detection_ms", "ms"),
    "pick_mm": FigureRow("vision.picks:pick_mm", "mm", takes_count=True, takes_seed=True),
    "pick_success": FigureRow("vision.picks:pick_success", "%", takes_count=True, takes_seed=True),
    "replay_speed": FigureRow("recording:replay_speed", "x real time"),
    "simulate_speed": FigureRow("simulation:simulate_speed", "x real time"),
    "simulate_start_ms": FigureRow("simulation:simulate_start_ms", "ms"),
    "stream_lag_ms": FigureRow("stream_lag:stream_lag_ms", "ms"),
    "stream_watch_cpu": FigureRow("stream_watch:stream_watch_cpu", "%"),
    "lerobot_loop_hz": FigureRow("lerobot:lerobot_loop_hz", "Hz"),
    "lerobot_lag_ms": FigureRow("lerobot:lerobot_lag_ms", "ms"),
    "lost_of_45000_at_25hz": FigureRow("virtual_time:lost_of_45000_at_25hz", "chunks"),
    "seed_move_percent": FigureRow("old_dialects:seed_move_percent", "%"),
    "ra_remainder_steps": FigureRow("ra_remainder:ra_remainder_steps", "steps"),
    "text_link_ms": FigureRow("old_dialects:text_link_ms", "ms"),
    "clock_sync_error_us": FigureRow("virtual_time:clock_sync_error_us", "us"),
    "hold_reaction_ms": FigureRow("virtual_time:hold_reaction_ms", "ms"),
    "stopping_distance": FigureRow("stopping:stopping_distance", "said / true"),
    "ledger": FigureRow("ledger:ledger", "% of sure states"),
    "gripper_reaction_ms": FigureRow("gripper:gripper_reaction_ms", "ms"),
    "max_step_rate_hz": FigureRow("pulses:max_step_rate_hz", "steps/s"),
    "parse_mb_per_s": FigureRow("firmware_cost:parse_mb_per_s", "MB/s"),
    "step_time_error_us": FigureRow("pulses:step_time_error_us", "us"),
    "estop_reaction_ticks": FigureRow("pulses:estop_reaction_ticks", "ticks"),
    "render_ms": FigureRow("vision.eyes:render_ms", "ms"),
    "cli_start_ms": FigureRow("stack:cli_start_ms", "ms"),
    "import_gemelo_ms": FigureRow("stack:import_gemelo_ms", "ms"),
    "handshake_ms": FigureRow("handshake:handshake_ms", "ms"),
    "ros_bridge_cpu_percent": FigureRow("ros:ros_bridge_cpu_percent", "% of one core"),
    "ros_latency_ms": FigureRow("ros:ros_latency_ms", "ms"),
    "broker_echo_ms": FigureRow("brokers:broker_echo_ms", "ms"),
    "arms_on_one_router": FigureRow("many_arms:arms_on_one_router", "arms"),
    "tick_instructions": FigureRow("firmware_cost:tick_instructions", "instr"),
    "slot_instructions": FigureRow("firmware_cost:slot_instructions", "instr"),
    "core_text_bytes": FigureRow("firmware_cost:core_text_bytes", "bytes"),
    "core_ram_bytes": FigureRow("firmware_cost:core_ram_bytes", "bytes"),
    "device_static_ram": FigureRow("firmware_cost:device_static_ram", "bytes"),
    "idle_cpu_percent": FigureRow("light:idle_cpu_percent", "% of one core", True),
    "moving_cpu_percent": FigureRow("light:moving_cpu_percent", "% of one core", True),
    "idle_pss_mb": FigureRow("light:idle_pss_mb", "MB", True),
    "state_to_frame_ms": FigureRow("frames:state_to_frame_ms", "ms", True),
    "image_path_ms": FigureRow("vision.eyes:image_path_ms", "ms", True),
    "stream_lag_live_ms": FigureRow("stream_live:stream_lag_live_ms", "ms", on_a_stack=True),
    "move_accept_to_first_step_ms": FigureRow("latency:move_accept_to_first_step_ms", "ms", True),
    "program_legs": FigureRow("program_legs:program_legs", "ms", True),
    "stop_ms": FigureRow("stops:stop_ms", "ms", True),
    "chunk_ack_ms": FigureRow("latency:chunk_ack_ms", "ms", True, "mosquitto"),
    "chunk_ack_tls_ms": FigureRow("latency:chunk_ack_tls_ms", "ms", True),
    "chunk_ack_ms_embedded": FigureRow("latency:chunk_ack_ms", "ms", True, "embedded"),
    "panel_cpu_percent": FigureRow("panel:panel_cpu_percent", "% of one core", True),
    "panel_lag_ms": FigureRow("panel:panel_lag_ms", "ms", True),
    "stop_key_ms": FigureRow("panel:stop_key_ms", "ms", True),
    "goal_drag_hz": FigureRow("panel:goal_drag_hz", "1/s", True),
    "record_cpu_percent": FigureRow("recording:record_cpu_percent", "% of one core", True),
    "record_mb_per_hour": FigureRow("recording:record_mb_per_hour", "MB/h", True),
    "blackbox_ms": FigureRow("recording:blackbox_ms", "ms", True),
    "blackbox_cpu_percent": FigureRow("recording:blackbox_cpu_percent", "% of one core", True),
    "ready_s": FigureRow("stack:ready_s", "s", True),
}


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="make bench", description="Measure the figures of this machine.")
    parser.add_argument("--only", nargs="+", choices=FIGURES, metavar="NAME", help=", ".join(FIGURES))
    parser.add_argument("--out", type=Path, default=project_root() / "out/bench.json")
    said = f"problems of each arm and family for plan_*, refusal_ms, and picks of each arm ({FEW}; 100 take an hour)"
    parser.add_argument("--problems", type=int, default=FEW, metavar="N", help=said)
    parser.add_argument("--seed", type=int, default=SEED, metavar="N", help=f"by which picks are drawn ({SEED})")
    options = parser.parse_args()
    try:
        with ended_by_signals():
            sys.exit(bench(options.only or FIGURES, options.out, options.problems, options.seed))
    except KeyboardInterrupt:
        sys.exit("bench: ended before all was measured; its stack has been stopped")


def bench(names: Iterable[str], out: Path, problems: int = FEW, seed: int = SEED) -> int:
    """Measures the figures `names`, writes `out` and prints the table; returns the exit code. `problems` are those of
    each arm and family for the figures that count them, drawn by `seed` for those that draw."""
    wanted = set(names)
    figures: dict[str, Figure] = {}
    with Stacks() as stacks:
        for name in (name for name in FIGURES if name in wanted):
            print(f"bench: {name} ...", flush=True)
            figures[name] = measured(FIGURES[name], stacks, problems, seed)
    report = report_of(figures, project_root())
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    print(f"\n{text_of(report)}\n\nwritten to {out}")
    return 1 if any(figure.median is None for figure in figures.values()) else 0


def measured(row: FigureRow, stacks: Stacks, problems: int, seed: int) -> Figure:
    """The figure of one row of the table; it says why if it could not be measured."""
    arguments: list[object] = [stacks] if row.on_a_stack else [problems] if row.takes_count else []
    arguments += [seed] if row.takes_seed else []
    return guarded(partial(function_of(row), *arguments, *filter(None, [row.broker])), row.unit)


def function_of(row: FigureRow) -> Callable[..., Figure]:
    """The function that measures; its module is imported now, because pinocchio and yourdfpy are slow to load."""
    module, name = row.function.split(":")
    function: Callable[..., Figure] = getattr(importlib.import_module(f"gemelo.tools.bench.{module}"), name)
    return function


if __name__ == "__main__":
    main()
