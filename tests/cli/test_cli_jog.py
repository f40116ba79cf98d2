"""`gemelo jog`: what the keys mean, a terminal that is as it was afterwards, and the commands on a bus in memory."""

from __future__ import annotations

import math
import os
import pty
import signal
import termios
import threading
import time
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.planning import JogCommand, JogLimit, JogStatus
from gemelo.schemas.topics import JOG, JOG_STATUS
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.main import run
from gemelo.tools.cli.motion.jog import command_of, jog_by_hand, jog_for
from gemelo.tools.cli.motion.jog_keys import FASTER, FIRST_SPEED, HELD, TOOL_SPEED, JogKeys, keyboard

TURN = JogCommand(name=("brazo_joint",), velocity=(0.2,))


@pytest.fixture
def keys(arm) -> JogKeys:
    return JogKeys(arm.joints, arm.tool_frame)


@pytest.mark.parametrize(
    ("key", "linear"),
    [("w", (1, 0, 0)), ("s", (-1, 0, 0)), ("a", (0, 1, 0)), ("d", (0, -1, 0)), ("q", (0, 0, 1)), ("e", (0, 0, -1))],
)
def test_letters_move_the_tool(keys, key, linear):
    keys.press(key, 1.0)
    assert keys.command(1.0).linear == pytest.approx([FIRST_SPEED * TOOL_SPEED * share for share in linear])


def test_a_digit_chooses_a_joint_and_arrows_move_it_at_the_chosen_speed(keys, arm):
    keys.press("2", 1.0)
    assert keys.command(1.0) is None
    keys.press("\x1b[A", 1.0)
    command = keys.command(1.0)
    assert command.name == ("antebrazo_joint",)
    assert command.velocity == pytest.approx((FIRST_SPEED * arm.joints[1].velocity,))
    keys.press("+\x1bOB", 1.1)
    assert keys.command(1.1).velocity == pytest.approx((-FASTER * FIRST_SPEED * arm.joints[1].velocity,))
    keys.press("9", 1.2)
    assert "antebrazo_joint" in keys.line


def test_a_key_that_does_not_repeat_has_been_let_go_and_any_other_key_stops(keys):
    keys.press("w", 1.0)
    assert keys.command(1.0 + 0.9 * HELD) is not None
    assert keys.command(1.0 + 1.1 * HELD) is None
    for stop in (" ", "z", "\x1b[5~"):
        keys.press("w", 2.0)
        keys.press(stop, 2.01)
        assert keys.command(2.02) is None
    assert not keys.wants_to_leave
    keys.press("x", 2.1)
    assert keys.wants_to_leave


def test_the_speed_stays_within_the_limits_and_the_frame_can_be_the_tool(keys, arm):
    keys.press("+" * 50 + "t", 1.0)
    assert keys.speed == 1.0
    keys.press("w", 1.0)
    assert keys.command(1.0).frame == arm.tool_frame
    keys.press("-" * 50, 1.0)
    assert keys.speed == pytest.approx(0.01)


def test_speeds_are_written_with_their_units(arm):
    command = command_of(arm, ["brazo_joint=10deg/s", "q3=5mm/s"], [], [], False)
    assert command.name == ("brazo_joint", "efector_joint")
    assert command.velocity == pytest.approx((math.radians(10.0), 0.005))
    twist = command_of(arm, [], [0.1, 0.0, 0.0], [0.0, 0.0, math.pi / 2], True)
    assert twist.angular == pytest.approx((0.0, 0.0, math.pi / 2))
    assert twist.frame == arm.tool_frame
    with pytest.raises(CommandError, match='did you mean "brazo_joint"'):
        command_of(arm, ["braso_joint=1deg/s"], [], [], False)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["jog"], "no terminal to read keys from: give --joint or --twist"),
        (["jog", "--joint", "brazo_joint=10deg/s"], "--for so many seconds"),
        (["jog", "--joint", "brazo_joint=1deg/s", "--twist", "1", "0", "0", "--for", "1"], "exclude one another"),
    ],
)
def test_what_cannot_be_done_is_refused_with_the_remedy(words, said, monkeypatch, capsys):
    with open(os.devnull) as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        assert run(words) is ExitCode.USAGE
    assert said in capsys.readouterr().err


@pytest.fixture
def terminal(monkeypatch) -> Iterator[tuple[int, int]]:
    """The two ends of a pseudo-terminal that is this process's standard input."""
    outer, inner = pty.openpty()
    with os.fdopen(inner, "r") as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        yield outer, inner
    os.close(outer)


@pytest.mark.parametrize("number", [None, signal.SIGTERM, signal.SIGHUP])
def test_the_terminal_is_as_it_was_whatever_ends_the_command(terminal, number):
    outer, inner = terminal

    def use_it() -> None:
        with keyboard() as typed:
            assert not termios.tcgetattr(inner)[3] & termios.ICANON
            os.write(outer, b"w\x1b[A")
            assert typed(0.0) == "w\x1b[A"
            assert typed(0.0) == ""
            if number is None:
                raise ZeroDivisionError
            os.kill(os.getpid(), number)

    before = termios.tcgetattr(inner)
    with pytest.raises(KeyboardInterrupt if number else ZeroDivisionError):
        use_it()
    assert termios.tcgetattr(inner) == before


class PretendPlanner:
    """Says what it is told to for every command that it hears."""

    def __init__(self, node: Node) -> None:
        self.commands: list[JogCommand] = []
        limit = JogLimit(check="joint limit", subject="brazo_joint", message="joint limit of brazo_joint")
        self.answer = JogStatus(active=True, limited_by=limit.message, limits=(limit,))
        self.ends_after = 1_000_000  # commands: then it is dead
        self._heard = -1.0
        self._node, self._status = node, node.publisher(JOG_STATUS)
        node.subscribe(JOG, self._on_command)

    def step(self, now: int) -> None:
        if self._heard >= 0.0 and self._node.monotonic() - self._heard > 0.1:
            self._heard = -1.0
            self._status.put(JogStatus())

    def _on_command(self, command: JogCommand) -> None:
        self.commands.append(command)
        if len(self.commands) > self.ends_after:
            self._heard = -1.0
            return
        self._heard = self._node.monotonic()
        self._status.put(self.answer)


@pytest.fixture
def jogger(network, deployment) -> Iterator[PretendPlanner]:
    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        made = PretendPlanner(node)
        thread = threading.Thread(target=lambda: node.spin(made.step, rate=50.0))
        thread.start()
        yield made
        node.stop()
        thread.join()


def test_a_script_jogs_for_so_long_and_tells_where_it_stands_and_what_limited_it(connected, gateway, jogger, capsys):
    assert jog_for(connected, TURN, 0.4) is ExitCode.OK
    assert len(jogger.commands) > 3
    assert all(command.velocity == (0.2,) and command.stamp > 0 for command in jogger.commands)
    said = capsys.readouterr().out
    assert "brazo_joint 28.65 deg" in said
    assert said.rstrip().endswith("limited by joint limit of brazo_joint")


def test_a_refusal_is_the_sentence_of_the_planner(connected, gateway, jogger):
    jogger.answer = JogStatus(active=False, limited_by="a goal is being carried out: cancel it first")
    with pytest.raises(CommandError, match="refused: a goal is being carried out: cancel it first"):
        jog_for(connected, TURN, 5.0)


@pytest.mark.parametrize("seconds", [5.0, 0.1])
def test_without_a_planner_it_ends_with_the_remedy(connected, gateway, seconds):
    with pytest.raises(CommandError, match="the planner does not answer") as silent, reported(load_robot()):
        jog_for(connected, TURN, seconds)
    assert silent.value.code is ExitCode.NO_STACK


def test_a_planner_that_dies_in_the_middle_of_a_jog_ends_it_and_is_named(connected, gateway, jogger):
    jogger.ends_after = 10
    said = "sent nothing for 1 s: the arm has stopped in the middle of the jog"
    with pytest.raises(CommandError, match=said), reported(load_robot()):
        jog_for(connected, TURN, 5.0)
    assert len(jogger.commands) < 150  # 5 s of them would be 250


def test_a_stream_that_nobody_follows_says_so(connected):
    began = time.monotonic()

    def stream() -> None:
        while time.monotonic() < began + 5.0:
            connected.stream({"brazo_joint": 0.1})
            time.sleep(0.02)

    with pytest.raises(gemelo.Lost, match="nothing received of joint_states for 1 s: no target is followed"):
        stream()
    assert time.monotonic() - began > 1.0  # which is given to a twin that has just been found


def test_keys_jog_until_they_are_let_go_and_x_leaves(connected, gateway, jogger, terminal, capsys):
    outer, inner = terminal
    before = termios.tcgetattr(inner)

    def type_keys() -> None:
        for _ in range(200):  # what is typed before the keys are read one by one is lost
            if jogger.commands:
                break
            os.write(outer, b"w")
            pause.wait(0.05)
        pause.wait(0.5)
        heard.append(len(jogger.commands))
        pause.wait(0.3)
        for _ in range(3):
            os.write(outer, b"x")
            pause.wait(0.1)

    pause, heard = threading.Event(), list[int]()
    typist = threading.Thread(target=type_keys)
    typist.start()
    assert jog_by_hand(connected) is ExitCode.OK
    typist.join()
    assert jogger.commands[0].linear == pytest.approx((FIRST_SPEED * TOOL_SPEED, 0.0, 0.0))
    assert len(jogger.commands) == heard[0]
    assert termios.tcgetattr(inner) == before
    assert "space stop" in capsys.readouterr().out
