"""The black box as a person meets it: something happens in the middle of a move, and the next command says what."""

from __future__ import annotations

import json
import subprocess
import time

from mcap.reader import make_reader

from services.visualizer.program.rerun_program import rerun_binary
from tests.stack.gemelo import gemelo

SAVED = 25.0  # [s] 3 s of what follows, 10 s between two files, the census's 5 s, and a slow machine


def boxes(stack) -> list[dict]:
    return json.loads(gemelo(stack, "blackbox", "list", "--json"))


def next_box(stack, before: int) -> dict:
    deadline = time.monotonic() + SAVED
    while len(found := boxes(stack)) <= before:
        assert time.monotonic() < deadline, "no black box was saved"
        time.sleep(1.0)
    return found[0]["incident"]


def send_slowly(operator):
    plan = operator.plan(speed=0.6)
    handle = operator.send(plan)
    assert operator.wait_for(lambda: handle.feedback is not None and handle.feedback.elapsed > 0.5, 10.0)
    return handle


def test_a_killed_planner_and_an_emergency_stop_are_told_afterwards(stack, operator, tmp_path):
    assert not boxes(stack)
    stack.kill("planner")
    lost = next_box(stack, 0)
    assert lost["kind"] == "service lost"
    assert "planner" in lost["sentence"]
    stack.wait_ready(20.0)

    handle = send_slowly(operator)
    gemelo(stack, "device", "press", "estop")
    handle.wait(10.0)
    stop = next_box(stack, 1)
    assert stop["kind"] == "emergency stop"
    assert f"s into goal {handle.goal_id[:8]}" in stop["sentence"]
    story = [each["text"] for each in stop["story"]]
    goal = f"goal {handle.goal_id[:8]}"
    for part in ("planned, ", f"{goal} for", "device/inject", "-> ESTOP", f"{goal} aborted"):
        assert any(part in text for text in story), (part, story)
    assert len(stop["margins"]) == 5
    assert "emergency stop" in gemelo(stack, "blackbox", "show", "1")

    newest = max((stack.out / "blackbox").glob("*.mcap"))
    with newest.open("rb") as file:
        kept = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    with newest.open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert {"gemelo", "deployment", "robot", "layout"} <= set(kept)
    assert json.loads(kept["layout"]["json"])["window"] > 0.0
    assert {"log", "nodes"} <= topics  # parameters and interfaces are in the latter

    view = tmp_path / "view.rrd"
    gemelo(stack, "blackbox", "open", "1", "--save", str(view))
    text = subprocess.run([rerun_binary(), "rrd", "print", view], capture_output=True, text=True, check=True).stdout
    assert "/story" in text
    assert "/device/mode" in text
    assert len(list((stack.out / "blackbox").glob("*.mcap"))) == 2
