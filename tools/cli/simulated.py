"""`gemelo --simulate COMMAND`: one command line against a twin of its own, in virtual time."""

from __future__ import annotations

import os
import tempfile
from contextlib import ExitStack
from typing import TYPE_CHECKING

import gemelo
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import usage

if TYPE_CHECKING:
    from gemelo import Arm, Robot, SimulatedArm
    from gemelo.libraries.runtime.node import Node

OPTION = "--simulate"
KEEPER = "cli-simulation"  # the node that keeps the twin; `gemelo node list` leaves it out


class SimulatedTwin:
    """The twin of this process: it begins with the first connection, and ends with the command."""

    def __init__(self, start: str) -> None:
        """`start`: a named state or "unreferenced"; empty is the reference pose."""
        self._start = start
        self._arm: SimulatedArm | None = None
        self._ending = ExitStack()

    def connect(self, robot: Robot, name: str) -> Arm:
        """Another connection; raises the errors of `gemelo`."""
        return self._keeper(robot).sim.connect(name)

    def node(self, robot: Robot, name: str) -> Node:
        """Another node on its bus; raises the errors of `gemelo`."""
        return self._keeper(robot).sim.node(name)

    def close(self) -> None:
        self._ending.close()

    def _keeper(self, robot: Robot) -> SimulatedArm:
        if self._arm is None:
            folder = self._ending.enter_context(tempfile.TemporaryDirectory(prefix="gemelo-control-"))
            os.environ.setdefault("GEMELO_CONTROL", f"{folder}/control.json")  # no hold of a real arm is shared
            cell = robot.deployment.cell
            simulation = self._ending.enter_context(gemelo.Simulation())
            self._arm = simulation.add(robot, start=self._start or None, cell=cell, name=KEEPER)
        return self._arm


class _Chosen:
    twin: SimulatedTwin | None = None


def chosen() -> SimulatedTwin | None:
    """The simulated twin of this command line; None where it is for the stack that runs."""
    return _Chosen.twin


def choose(option: str) -> None:
    """`--simulate`, or `--simulate=START`; raises `CommandError` for an empty start."""
    _, equals, start = option.partition("=")
    if equals and not start:
        raise usage(because("cli.simulate.start", option=OPTION))
    _Chosen.twin = SimulatedTwin(start)


def end() -> None:
    """The command has ended, and its twin with it."""
    twin, _Chosen.twin = _Chosen.twin, None
    if twin is not None:
        twin.close()
