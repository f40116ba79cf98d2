"""Words of the planner about a jog, as its client takes them."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from gemelo import Refused
from gemelo.api.jog import BEGIN, PERIOD, JogCommands
from gemelo.schemas.planning import JogCommand, JogStatus

BUSY = JogStatus(limited_by="a goal is being carried out: cancel it first")
HELD = JogStatus(limited_by="ana holds control", check="control")
COMMAND = JogCommand(name=("a",), velocity=(0.1,))


class Planner:
    """Its newest word, and the bus to it, on a clock of its own [s]."""

    def __init__(self) -> None:
        self.now = 100.0
        self.said: list[JogCommand] = []
        self._tell: Callable[[JogStatus], None] = lambda status: None
        self.clock = SimpleNamespace(monotonic=lambda: self.now)
        publisher = SimpleNamespace(put=self.said.append)
        self.node = SimpleNamespace(name="me", address="me", now=lambda: 0, publisher=lambda topic: publisher)

    def latest(self, topic: object, on_news: Callable[[JogStatus], None]) -> None:
        self._tell = on_news

    def says(self, status: JogStatus, after: float) -> None:
        self.now += after
        self._tell(status)


@pytest.fixture
def planner() -> Planner:
    return Planner()


def commands(planner: Any) -> JogCommands:
    made = JogCommands(planner)
    made.say(COMMAND)
    return made


def test_a_goal_that_has_just_ended_refuses_no_jog(planner: Planner) -> None:
    jog = commands(planner)
    planner.says(BUSY, 2.0 * PERIOD)
    jog.say(COMMAND)
    planner.says(JogStatus(active=True), 0.5 * BEGIN)
    status = jog.say(COMMAND)
    assert status is not None
    assert status.active
    assert len(planner.said) == 3


def test_a_goal_that_goes_on_refuses_it(planner: Planner) -> None:
    jog = commands(planner)
    for _ in range(3):
        planner.says(BUSY, 0.3 * BEGIN)
        jog.say(COMMAND)
    planner.says(BUSY, 0.2 * BEGIN)
    with pytest.raises(Refused, match="cancel it first"):
        jog.say(COMMAND)


def test_who_does_not_hold_control_is_refused_at_once(planner: Planner) -> None:
    jog = commands(planner)
    planner.says(HELD, 2.0 * PERIOD)
    with pytest.raises(Refused, match="ana"):
        jog.say(COMMAND)
