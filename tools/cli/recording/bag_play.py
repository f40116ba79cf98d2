"""`gemelo bag play`: a recording as a shadow robot, on which the viewer and every tool work."""

from __future__ import annotations

import logging
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from gemelo.libraries.recordings.export import chosen, topics_in
from gemelo.libraries.recordings.player import NODE, Player, Roles
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.recordings.shadow import NAME, recorded_robot, shadow_folder, write_shadow
from gemelo.libraries.runtime.bus.connection import connect
from gemelo.libraries.runtime.bus.interface import Bus
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import load_robot, require_router
from gemelo.tools.cli.motion.jog_keys import keyboard
from gemelo.tools.cli.parser import Options, Parser
from gemelo.tools.cli.recording.bag import file_option, one_sentence

RATE = 100.0  # [Hz] of looks at what is due
LEAVE = ("q", "x", "\x03", "\x04")


class PlayerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """How it plays; `gemelo --robot NAME param set player paused true` from elsewhere."""

    rate: Annotated[float, Meta(description="times real time", gt=0)] = 1.0
    paused: Annotated[bool, Meta(description="stand still")] = False
    step: Annotated[int, Meta(description="counts single steps: a higher number plays one more each", ge=0)] = 0


def add_options(parser: Parser) -> None:
    """Adds file, topics, name, rate, start, loop and paused."""
    file_option(parser)
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topics or patterns, as 'device/*' [all]")
    parser.add_argument("--as", dest="name", default="", metavar="NAME", help="of the shadow robot [<robot>-replay]")
    parser.add_argument("-r", "--rate", type=rate_argument, default=1.0, metavar="X", help="times real time [1]")
    parser.add_argument("--start", type=start_argument, default=0.0, metavar="S", help="[s] after the beginning [0]")
    parser.add_argument("-l", "--loop", action="store_true", help="again and again, until Ctrl-C")
    parser.add_argument("-p", "--paused", action="store_true", help="begin with a pause")


def rate_argument(text: str) -> float:
    """An argument's type: a finite factor of the recorded speed, above 0; dimensionless."""
    return _number(text, lambda value: value > 0.0, "cli.play.rate")


def start_argument(text: str) -> float:
    """An argument's type: a finite time [s] of 0 or more."""
    return _number(text, lambda value: value >= 0.0, "cli.play.seconds")


def _number(text: str, is_possible: Callable[[float], bool], code: str) -> float:
    with suppress(ValueError):
        value = float(text)
        if is_possible(value) and value < float("inf"):
            return value
    raise ArgumentTypeError(sentence(because(code, text=text)))


def run(options: Options) -> ExitCode:
    """Plays a recording to its end, or until Ctrl-C."""
    with one_sentence():
        reader = RecordingReader(options.file)
        reader.require_own()
        robot = recorded_robot(reader)
        name = options.name or f"{robot or 'robot'}-replay"
        require_name(name)
        topics = chosen(topics_in(reader), options.topics)
        player = Player(reader, topics.__contains__, options.rate, options.start, options.loop, options.paused)
    if player.is_over:
        raise usage(because("cli.play.start", start=options.start))
    own = load_robot()
    if name == own.description.name:
        raise refused(name)
    require_router(own.deployment)
    with one_sentence():
        folder = shadow_folder(Path(own.deployment.paths.out), name)
        write_shadow(reader, folder, name, project_root() / "urdf" / robot)
    with roles(own.deployment, name, player) as as_nodes:
        say_how(name)
        play(own.deployment, name, player, as_nodes.put)
    return ExitCode.OK


def require_name(name: str) -> None:
    """Raises `CommandError` for a name that cannot be a key's first part."""
    if not NAME.fullmatch(name):
        raise usage(because("cli.play.name", name=name))


def refused(name: str) -> CommandError:
    return CommandError(because("cli.play.living", name=name))


@contextmanager
def roles(deployment: Deployment, name: str, player: Player) -> Iterator[Roles]:
    """Yields the right to speak as the recorded nodes; raises `CommandError` where one of them lives under `name`."""
    bus: Bus = connect(deployment.router, name, logging.getLogger("gemelo.player"), ShutdownRequest())
    try:
        found = Roles(bus)
        try:
            found.claim(player.writers)
        except NodeNameTaken as error:
            raise refused(name) from error
        yield found
    finally:
        bus.close()


def play(deployment: Deployment, name: str, player: Player, put: Callable[..., None]) -> None:
    """Says what is due until the recording has ended."""
    overrides = {"rate": player.rate, "paused": player.is_paused}
    with Node(NODE, deployment, robot=name, overrides=overrides) as node, keys() as typed:
        parameters = node.parameters(PlayerParameters)
        last, stepped = node.monotonic(), 0

        def step(now: int) -> None:
            nonlocal last, stepped
            at, before = node.monotonic(), last
            last = at
            for key in typed():
                press(node, parameters.value, key)
            present = parameters.value
            player.rate, player.is_paused = present.rate, present.paused
            for row in player.due(at - before):
                put(row)
            while stepped < present.step and not player.is_over:
                stepped += 1
                for row in player.step():
                    put(row)
            if player.is_over and not player.loop:
                node.stop()

        node.spin(step, rate=RATE)
        played = because("cli.play.played", count=player.played, time=player.position)
        print(sentence(played), flush=True)


def press(node: Node, present: PlayerParameters, key: str) -> None:
    """Space: pause or go on; `.` or s: one step; + and -: twice or half as fast; q: end."""
    if key == " ":
        node.set_parameter("paused", not present.paused)
    elif key in ".s":
        node.set_parameter("paused", True)
        node.set_parameter("step", present.step + 1)
    elif key in "+-":
        node.set_parameter("rate", present.rate * (2.0 if key == "+" else 0.5))
    elif key in LEAVE:
        node.stop()


@contextmanager
def keys() -> Iterator[Callable[[], str]]:
    """Yields a function that returns the keys typed since its last call; none where there is no terminal."""
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    print(sentence(because("cli.play.keys")), flush=True)
    with keyboard() as typed:
        yield lambda: typed(0.0)


def say_how(name: str) -> None:
    print(sentence(because("cli.play.begun", name=name)), flush=True)
