"""The whole stack as a user starts it: ready, on loopback, moved by the command line, to the step."""

from __future__ import annotations

import ipaddress
import re
import signal
import socket
import subprocess
import time
import urllib.request

import psutil
import pytest

import gemelo as api
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.tools.stack.stack import PROCESSES, Stack
from tests.stack.person import jumps
from tests.stacks.shared import found_by_scripts


def gemelo(stack, *arguments, timeout=30):
    return subprocess.run(
        [stack.root / ".venv/bin/gemelo", *arguments],
        cwd=stack.root,
        env=stack.environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=timeout,
    )


def test_every_process_is_ready(stack):
    """That each was started once tests/smoke shows, on a stack that nobody has killed anything of."""
    assert set(stack.pids()) == set(stack.processes)


def test_process_compose_sees_the_same_readiness(stack):
    deadline = time.monotonic() + 60.0
    waiting = set(stack.processes)
    while waiting and time.monotonic() < deadline:
        waiting -= {name for name in waiting if stack.compose.process(name).is_ready == "Ready"}
        time.sleep(0.1)
    assert not waiting


def test_everything_listens_on_loopback_only(stack):
    for name, pid in stack.pids().items():
        process = psutil.Process(pid)
        for each in [process, *process.children(recursive=True)]:
            for connection in each.net_connections("inet"):
                is_open = connection.status == psutil.CONN_LISTEN or connection.type == socket.SOCK_DGRAM
                if is_open and connection.laddr:
                    assert ipaddress.ip_address(connection.laddr.ip).is_loopback, (
                        f"{name} listens on {connection.laddr}"
                    )


def test_a_named_move_by_the_command_line_succeeds_and_says_how_exactly(stack):
    moved = gemelo(stack, "move", "--named", "ready")
    assert moved.returncode == 0, moved.stdout + moved.stderr
    assert "mm" in moved.stdout
    assert "step" in moved.stdout


def test_a_tool_position_by_the_command_line_succeeds(stack):
    moved = gemelo(stack, "move", "--to", "0.25", "0.15", "0.10")
    assert moved.returncode == 0, moved.stdout + moved.stderr


def test_a_goal_out_of_reach_is_refused_with_the_reason(stack):
    refused = gemelo(stack, "move", "--to", "9", "9", "9")
    assert refused.returncode != 0
    assert "Traceback" not in refused.stderr
    assert refused.stdout + refused.stderr


def test_the_state_by_the_command_line(stack, operator):
    told = gemelo(stack, "state")
    assert told.returncode == 0, told.stderr
    for name in operator.arm.joint_names:
        assert name in told.stdout


def test_a_reader_that_has_enough_ends_a_listing_without_a_word(stack):
    listing = subprocess.Popen(
        [stack.root / ".venv/bin/gemelo", "topic", "hz", "joint_states"],
        cwd=stack.root,
        env=stack.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert "average rate" in listing.stdout.readline()
    listing.stdout.close()
    assert listing.wait(60.0) == 0
    assert listing.stderr.read() == ""
    listing.stderr.close()


def test_a_move_ends_with_every_commanded_step_executed(operator):
    outcome = operator.move()
    assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
    assert outcome.result.error_code is FollowErrorCode.SUCCESSFUL
    assert outcome.result.executed_steps == outcome.result.commanded_steps
    assert max(abs(error) for error in outcome.result.final_error) <= 0.5
    assert not jumps(operator.arm, operator.seen)


def test_a_parameter_of_the_gateway_counts_from_the_moment_it_is_set(stack, operator):
    counts = {}
    for rate in ("2.0", "20.0"):
        told = gemelo(stack, "param", "set", "stepper_gateway", "feedback_rate", rate)
        assert told.returncode == 0, told.stderr
        heard = []
        plan = operator.plan()
        goal = FollowJointTrajectoryGoal(trajectory=plan.trajectory)
        outcome = operator.follow.send(goal, on_feedback=heard.append).wait(plan.duration + 10.0)
        assert outcome.status is GoalStatusCode.SUCCEEDED
        counts[rate] = len(heard) / plan.duration
    assert counts["2.0"] < 5.0 < counts["20.0"]


def test_the_logger_writes_a_new_file_only_while_it_is_told_to_record(stack):
    def recordings():
        return {path: path.stat().st_size for path in (stack.out / "recordings").glob("*.mcap")}

    assert gemelo(stack, "param", "set", "logger", "enable_logging", "false").returncode == 0
    time.sleep(1.0)
    before = recordings()
    time.sleep(1.5)
    assert recordings() == before
    assert gemelo(stack, "param", "set", "logger", "enable_logging", "true").returncode == 0
    deadline = time.monotonic() + 60.0
    while sum(recordings().values()) <= sum(before.values()) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert sum(recordings().values()) > sum(before.values())


def test_a_cancelled_move_decelerates_on_its_path(operator):
    plan = operator.plan(speed=0.5)
    handle = operator.send(plan)
    assert operator.wait_for(operator.is_moving, 60.0)
    handle.cancel()
    outcome = handle.wait(60.0)
    assert outcome.status is GoalStatusCode.CANCELED
    assert not jumps(operator.arm, operator.seen)


def test_every_log_is_kept_and_no_process_has_complained(stack):
    for name in stack.processes:
        text = stack.logs(name)
        assert "Traceback" not in text, f"{name}: {text[-2000:]}"


def test_ctrl_c_ends_everything_with_zero_and_leaves_nothing_behind(tmp_path):
    # As a user starts it: `Stack` alone leaves dependencies out, and with them the order of stopping.
    with Stack(broker="embedded", out=tmp_path, viewer="web", processes=PROCESSES, command=("deploy/up",)) as stack:
        stream_a_little(stack)
        pids = [psutil.Process(pid) for pid in stack.pids().values()]
        family = [each for pid in pids for each in [pid, *pid.children(recursive=True)]]
        started = time.monotonic()
        stack.server.send_signal(signal.SIGINT)
        assert stack.server.wait(60.0) == 0
        assert time.monotonic() - started < 10.0
        _gone, alive = psutil.wait_procs(family, timeout=60.0)
        assert not alive
        console = stack.console()
        assert "Traceback" not in console, console[-3000:]
        assert "WARNING" not in console, console[-3000:]
        logs = {name: stack.logs(name) for name in stack.processes}
        assert [name for name, log in logs.items() if "nanobind" in log or "leaked" in log] == []
        assert all(logs[name] for name in ("planner", "stepper_gateway")), "the logs are kept"


def stream_a_little(stack):
    """What is streamed to makes objects of the planner's native library, which are to be freed at the end."""
    with found_by_scripts(stack), api.connect(timeout=60.0) as arm:
        arm.reference()
        end = time.monotonic() + 20.0
        while abs(arm.joints["brazo_joint"] - 0.1) > 0.005:
            assert time.monotonic() < end
            arm.stream({"brazo_joint": 0.1})
        while arm.device.mode is not api.DeviceMode.IDLE:  # a device that is ended in a motion says that it holds
            assert time.monotonic() < end
            time.sleep(0.02)


def test_make_up_welcomes_the_user_and_a_sigterm_ends_it(tmp_path):
    with Stack(broker="embedded", out=tmp_path, viewer="web", command=("make", "--silent", "up")) as stack:
        deadline = time.monotonic() + 60.0
        while "stop it" not in stack.console() and time.monotonic() < deadline:
            time.sleep(0.1)
        welcome = stack.console().partition("gemelo is up: every process is ready.")[2]
        first, *others = re.findall(r"http://\S+", welcome)
        assert first == f"http://127.0.0.1:{stack.deployment['GEMELO_PANEL_PORT']}"
        with urllib.request.urlopen(first, timeout=60.0) as page:
            assert page.status == 200
        assert any(stack.deployment["GEMELO_VIEWER_WEB_PORT"] in other for other in others)
        family = [psutil.Process(pid) for pid in stack.pids().values()]
        family += [child for each in family for child in each.children(recursive=True)]
        stack.server.send_signal(signal.SIGTERM)
        stack.server.wait(60.0)
        assert not psutil.wait_procs(family, timeout=60.0)[1]


@pytest.mark.parametrize(
    ("script", "setting"), [("gemelo-router", "GEMELO_ROUTER_PORT"), ("gemelo-broker", "GEMELO_MQTT_PORT")]
)
def test_a_taken_port_is_named_with_the_setting_to_change(stack, tmp_path, script, setting):
    taken = stack.deployment[setting]
    ended = subprocess.run(
        [stack.root / ".venv/bin" / script],
        cwd=stack.root,
        env={**stack.environment, "GEMELO_PATHS_RUN": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=15,
    )
    assert ended.returncode == 1
    assert taken in ended.stdout + ended.stderr
    assert setting in ended.stdout + ended.stderr
    assert "Traceback" not in ended.stderr
