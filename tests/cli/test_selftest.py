"""`gemelo device selftest` on a simulated arm, with a person who presses its switches and answers."""

from __future__ import annotations

import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from datetime import date
from functools import partial
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.device.selftest_file import with_findings
from tests.simulated import TypedAt

Doing = Callable[[], object]


class Hand:
    """Standard input: each line is what the person types, after what he does."""

    def __init__(self, *lines: str | tuple[Doing, str]) -> None:
        self._lines = list(lines)

    def readline(self) -> str:
        if not self._lines:
            return ""
        line = self._lines.pop(0)
        if isinstance(line, tuple):
            line[0]()
            return line[1] + "\n"
        return line + "\n"

    def isatty(self) -> bool:
        return True


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    copied = tmp_path / "rm1"
    shutil.copytree(project_root() / "urdf/rm1", copied)
    monkeypatch.setenv("GEMELO_ROBOT", str(copied))
    return copied


@pytest.fixture
def arm(folder: Path) -> Iterator[gemelo.SimulatedArm]:
    with gemelo.simulate(str(folder)) as simulated:
        yield simulated


@pytest.fixture
def typed(arm: gemelo.SimulatedArm) -> TypedAt:
    return TypedAt(arm)


def pressed(arm: gemelo.SimulatedArm) -> list[str | tuple[Doing, str]]:
    """The answers up to the reference: each switch is pressed and let go."""
    press = arm.sim.press
    lines: list[str | tuple[Doing, str]] = [
        "y",
        "y",
        "y",
        (partial(press, "estop"), ""),
        (partial(press, "release"), ""),
    ]
    for name in ("limit_q1", "limit_q2", "limit_q3"):
        lines += [(partial(press, "switch", name, "on"), ""), (partial(press, "switch", name, "auto"), "")]
    return [*lines, ""]


def test_an_arm_that_is_wired_well_passes_every_check(arm, typed, monkeypatch):
    monkeypatch.setattr(sys, "stdin", Hand(*pressed(arm), *["y"] * 9))
    said = typed("device", "selftest")
    assert said.count("The board sees it.") == 4
    for name in arm.joint_names:
        for check in ("one step", "direction", "full speed"):
            assert f"ok         {name}: {check}" in said
    assert "brazo_joint has made one step of 0.0193 deg" in said
    assert "PROBLEM" not in said
    assert arm.device.mode is gemelo.DeviceMode.IDLE
    assert all(abs(place) < 1e-3 for place in arm.joints.values())  # every check leaves a joint where it was


def test_the_ramp_reaches_the_joint_s_full_speed(arm, typed, monkeypatch):
    monkeypatch.setattr(sys, "stdin", Hand(*pressed(arm), "y", "y", "y"))
    said = typed("device", "selftest", "q1")
    fastest = float(said.partition("at up to ")[2].partition(" deg/s")[0])
    assert fastest == pytest.approx(57.2958 * arm.description.joint("brazo_joint").velocity, rel=0.01)


def test_a_motor_that_turns_the_other_way_gets_no_further_and_is_turned_in_the_file_on_request(
    arm, typed, folder, monkeypatch
):
    monkeypatch.setattr(sys, "stdin", Hand(*pressed(arm), "y", "w"))
    before = (folder / "robot.toml").read_text()
    said = typed("device", "selftest", "antebrazo_joint", code=ExitCode.FAILED)
    assert "PROBLEM    antebrazo_joint: direction" in said
    assert "full speed\n" not in said.partition("PROBLEM")[2]
    assert "--apply writes what was found" in said
    assert (folder / "robot.toml").read_text() == before
    monkeypatch.setattr(sys, "stdin", Hand("y", *["s"] * 6, "", "y", "w"))
    typed("device", "selftest", "antebrazo_joint", "--apply", "--current", "q1=1.8", code=ExitCode.FAILED)
    after = (folder / "robot.toml").read_text()
    motors = {joint["name"]: joint["motor"] for joint in tomllib.loads(after)["joint"]}
    assert motors["antebrazo_joint"]["inverted"] is False  # it was true
    assert f'driver = "DM542T" # set to 1.8 A, {date.today().isoformat()}' in after
    changed = [line for line in after.splitlines() if line not in before.splitlines()]
    assert len(changed) == 2, changed


def test_a_switch_that_the_board_does_not_see_is_named_with_its_pin(arm, typed, monkeypatch):
    monkeypatch.setattr(sys, "stdin", Hand("y", "s", "s", "s", "", "", "q"))
    said = typed("device", "selftest", code=ExitCode.FAILED)
    assert "The board does not see limit_q1." in said
    assert "limit_q1: look at the wire to pin 32" in said
    assert "The rest is left out." in said


def test_a_switch_whose_wire_is_torn_is_seen_before_it_is_pressed(arm, typed, monkeypatch):
    tear = partial(arm.sim.press, "switch", "limit_q2", "on")
    monkeypatch.setattr(sys, "stdin", Hand("y", "s", "s", "s", (tear, "s"), "q"))
    said = typed("device", "selftest", code=ExitCode.FAILED)
    assert "limit_q2 is active though nobody presses it." in said


def test_it_asks_in_spanish(arm, typed, monkeypatch):
    monkeypatch.setattr(sys, "stdin", Hand("s", "o", "o", "t"))
    said = typed("--lang", "es", "device", "selftest")
    assert "¿Está libre el espacio alrededor del brazo?\n  [s]í, [n]o, [o]mitir, [t]erminar:" in said
    assert "omitido" in said


def test_nothing_is_tried_where_the_space_is_not_clear_or_nobody_answers(arm, typed, monkeypatch):
    monkeypatch.setattr(sys, "stdin", Hand("n"))
    typed("device", "selftest")
    monkeypatch.setattr(sys, "stdin", Hand())
    assert "standard input has ended" in typed("device", "selftest", code=ExitCode.CANCELLED)
    assert all(arm.device.state.referenced)


@pytest.mark.parametrize("word", ["q1=0", "q1=21", "q1=fast", "q1=nan", "q1"])
def test_a_current_that_is_none_is_refused(arm, typed, word):
    said = typed("device", "selftest", "--current", word, code=ExitCode.USAGE)
    assert f"--current {word}: a joint and its driver's current up to 20 A, as brazo_joint=1.8" in said


def test_a_joint_without_the_key_gets_it():
    text = '[[joint]]\nname = "a"\n\n[joint.motor]\ndriver = "D" # of the shop\npulses_per_turn = 400\n'
    changed = with_findings(text, ("a",), {"a": 0.8}, date(2026, 1, 2))
    assert tomllib.loads(changed)["joint"][0]["motor"]["inverted"] is True
    assert 'driver = "D" # set to 0.8 A, 2026-01-02' in changed
