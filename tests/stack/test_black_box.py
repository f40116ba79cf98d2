"""The black box as a person meets it: something happens in the middle of a move, and the next command says what."""

from __future__ import annotations

import json
import re
import shlex
import signal
import subprocess
import time
from pathlib import Path

from mcap.reader import make_reader

from gemelo.schemas.topics import STATISTICS
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.tools.cli.common.errors import ExitCode
from tests.runtime.support import until
from tests.stack.gemelo import gemelo

SECTION = re.compile(r"^# What happened\?\n.*?```bash\n(.*?)```", re.DOTALL | re.MULTILINE)
MAGIC = b"\x89MCAP0\r\n"  # with which a file of MCAP begins and ends
FILE = "out/recordings/….mcap"
SAVED = 25.0  # [s] 3 s of what follows, 10 s between two files, the census's 5 s, and a slow machine


def boxes(stack) -> list[dict]:
    return json.loads(gemelo(stack, "blackbox", "list", "--json"))


def boxes_since(stack, began: int) -> list[dict]:
    """The incidents from `began` [ns] UNIX on, the newest first."""
    found = [each["incident"] for each in boxes(stack)]
    return [each for each in found if each["stamp"] >= began]


def next_box(stack, began: int) -> dict:
    deadline = time.monotonic() + SAVED
    while not (found := boxes_since(stack, began)):
        assert time.monotonic() < deadline, "no black box was saved"
        time.sleep(1.0)
    return found[0]


def send_slowly(operator):
    plan = operator.plan(speed=0.6)
    handle = operator.send(plan)
    assert operator.wait_for(lambda: handle.feedback is not None and handle.feedback.elapsed > 0.5, 60.0)
    return handle


def stop_in_a_move(stack, operator):
    """Presses the emergency stop; the move's handle, and the black box."""
    handle = send_slowly(operator)
    pressed = time.time_ns()
    gemelo(stack, "device", "press", "estop")
    handle.wait(60.0)
    stop = next_box(stack, pressed)
    assert stop["kind"] == "emergency stop"
    return handle, stop


def test_a_killed_planner_and_an_emergency_stop_are_told_afterwards(stack, operator, tmp_path):
    nodes = list[str]()
    subscription = operator.node.subscribe(STATISTICS, lambda statistics: nodes.append(statistics.node))
    assert operator.wait_for(lambda: nodes.count("planner") > 1, 60.0), "what nobody has heard cannot be missed"
    subscription.close()
    began = time.time_ns()
    stack.kill("planner")
    lost = next_box(stack, began)
    assert lost["kind"] == "service lost"
    assert "planner" in lost["sentence"]
    stack.wait_ready(120.0)

    handle, stop = stop_in_a_move(stack, operator)
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
    assert len(boxes_since(stack, began)) == 2
    gemelo(stack, "device", "press", "release")
    gemelo(stack, "reset")


def test_the_six_lines_of_the_page_say_what_happened(stack, operator, tmp_path):
    """Ledger, black boxes and replay, as they are printed there, on a stack whose arm has just been stopped.

    In a recording of its own: strays of other tests are in the one before.
    """
    before = stack.kill("logger", signal.SIGTERM)
    assert until(lambda: stack.pid("logger") not in (0, before), 20.0)
    assert until(lambda: stack.is_ready("logger"), 20.0)
    stop_in_a_move(stack, operator)
    gemelo(stack, "device", "press", "release")
    gemelo(stack, "reset")
    found = SECTION.search((stack.root / "docs/what_happened.md").read_text(encoding="utf-8"))
    assert found is not None
    lines = [shlex.split(line, comments=True) for line in found[1].splitlines()]
    assert [words[:3] if words[1] == "blackbox" else words[:2] for words in lines] == [
        ["gemelo", "state"], ["gemelo", "blackbox", "list"], ["gemelo", "blackbox", "show"],
        ["gemelo", "blackbox", "open"], ["gemelo", "replay"], ["gemelo", "bag"],
    ]  # fmt: skip
    recording = str(max((stack.out / "recordings").glob("*.mcap")))  # the one that is being written
    told = {"state": "ledger ", "list": "emergency stop", "show": "device: RUN -> ESTOP", "open": "-> ESTOP",
            "info": "joint_states"}  # fmt: skip
    for _, *words in lines:
        typed = [recording if word == FILE else word for word in words]
        if typed[0] == "replay":
            replayed(stack, recording, typed)
            continue
        more = ["--save", str(tmp_path / "view.rrd")] if typed[1:2] == ["open"] else []  # for want of a person's eyes
        name = typed[1] if typed[0] in ("blackbox", "bag") else typed[0]
        assert told[name] in gemelo(stack, *typed, *more), name
    assert (tmp_path / "view.rrd").is_file()


def replayed(stack, recording: str, words: list[str]) -> None:
    """A file that is being written cannot be replayed, and says so; it ends properly with its logger."""
    assert "gemelo bag repair" in gemelo(stack, *words, code=ExitCode.USAGE)
    stack.kill("logger", signal.SIGTERM)
    ended = Path(recording)
    assert until(lambda: ended.read_bytes()[-8:] == MAGIC, 20.0)
    said = gemelo(stack, *words)
    assert re.search(r"[1-9]\d* of @request/plan: the same to the byte", said), said
    assert "no difference" in said
