"""Picking on the page: one pick at a time, its course for all browsers, and a Stop that ends it."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import pytest

import gemelo
from gemelo.schemas.reasons import because
from gemelo.services.panel.model.picks import Picks

CELL = SimpleNamespace(things=[SimpleNamespace(name="cup")], places=[SimpleNamespace(name="bin")])


class Arm:
    """One that picks until it is let go, or cancelled."""

    def __init__(self) -> None:
        self.goes_on, self.began = threading.Event(), threading.Event()

    def detect(self):
        return (gemelo.Seen("cup", gemelo.Pose((0.26, 0.16, 0.04)), 0.0001, "tag", "overhead", 0, ""),)

    def pick(self, thing, *, to, on_progress, is_cancelled):
        on_progress(because("pick.place", place=to, at=(1.0, 2.0, 3.0)))
        self.began.set()
        while not self.goes_on.wait(0.01):
            if is_cancelled():
                raise gemelo.Canceled("the pick was cancelled", gemelo.GoalStatusCode.CANCELED)
        on_progress(because("pick.carrying"))
        return gemelo.Picked(thing, to, gemelo.Pose((0.26, 0.16, 0.04)), 0.0001, 0.0, 1, 12.5, None)


@pytest.fixture
def page():
    told, woken = [], []
    arm = Arm()
    return SimpleNamespace(
        arm=arm, told=told, woken=woken, picks=Picks(arm, CELL, told.append, lambda: woken.append(1))
    )


def lines(page):
    return list(map(str, page.picks.lines))


def test_what_is_seen_is_shown(page):
    assert (page.picks.things, page.picks.places) == (("cup",), ("bin",))
    page.picks.look()
    assert lines(page) == ["cup (tag): 260.0 160.0 40.0 mm, +-0.10 mm by overhead"]
    assert page.woken


def test_a_second_press_is_told_that_it_is_busy_and_the_first_goes_on(page):
    thread = threading.Thread(target=page.picks.pick, args=("cup", "bin"))
    thread.start()
    assert page.arm.began.wait(60.0)
    page.picks.pick("cup", "bin")
    page.picks.look()
    assert [each.check for each in page.told] == ["busy", "busy"]
    assert lines(page) == ["bin: 1.0 2.0 3.0 mm"]
    page.arm.goes_on.set()
    thread.join(60.0)
    assert lines(page) == ["cup is at bin: seen +-0.1 mm, 12.5 s"]


def test_stop_ends_it_and_the_next_one_begins(page):
    ended = []

    def pick():
        try:
            page.picks.pick("cup", "bin")
        except gemelo.Canceled as error:
            ended.append(error)

    thread = threading.Thread(target=pick)
    thread.start()
    assert page.arm.began.wait(60.0)
    page.picks.on_stop()
    thread.join(60.0)
    assert len(ended) == 1
    page.arm.goes_on.set()
    page.picks.pick("cup", "bin")
    assert lines(page)[0].startswith("cup is at bin")
