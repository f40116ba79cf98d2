"""A browser that reads nothing for a while is not shown the past when it goes on; the others do not wait for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from gemelo.services.panel.view.own_pace import UNREAD
from gemelo.tools.bench.bare_browser import CAMERA, PROTOCOL, Said, messages_in
from tests.panel.memory_page import MemoryPage, memory_page
from tests.runtime.support import until

PICTURES = 50
UNDER_WAY = 3 * UNREAD  # pictures at most, with those that the browser's own side keeps
STEP = 0.01  # [rad] or [m] of the first joint from one picture to the next
LONGEST = 20.0  # [s] until a message that is due


class Watched:
    """The page while its first joint moves, and what each picture of it says of that joint's node."""

    def __init__(self, page: MemoryPage) -> None:
        self.page, self.drawn = page, 0
        [self._joint, *_] = page.panel.world.measured.joints
        self._numbers: dict[tuple[float, ...], int] = {}  # of the pictures, by the orientation

    def draw(self, pictures: int) -> None:
        name = self._joint.joint.name
        for _ in range(pictures):
            self.page.gateway.joints = {**self.page.gateway.joints, name: 0.1 + STEP * (self.drawn + 1)}
            self.page.draw()
            self.drawn += 1
            self._numbers[tuple(self._joint.node.wxyz)] = self.drawn

    def pictures_in(self, messages: list[Said]) -> list[int]:
        """The numbers of those that these messages show."""
        node = self._joint.node.name
        shown = [
            tuple(said["wxyz"]) for said in messages if said["type"] == "SetOrientationMessage" and said["name"] == node
        ]
        return [self._numbers[each] for each in shown if each in self._numbers]

    def buffered(self) -> int:
        """Messages that the page keeps for the newest browser alone."""
        # viser tells nobody what it keeps for a browser.
        states = self.page.panel.server._websock_server._client_state_from_id
        return len(states[max(states)].message_buffer.message_from_id)


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[Watched]:
    with memory_page("rm1", tmp_path) as page:
        yield Watched(page)


@contextmanager
def slow_browser(watched: Watched) -> Iterator[Connection]:
    """One that has read what a page begins with; it reads nothing by itself, and keeps one message at most."""
    with connect(f"ws://127.0.0.1:{watched.page.port}", subprotocols=[PROTOCOL], max_size=None, max_queue=1) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        assert until(lambda: len(watched.page.panel.pages()) == 2)
        watched.draw(1)
        while watched.drawn not in watched.pictures_in(messages_of(socket)):
            pass
        yield socket


def messages_of(socket: Connection) -> list[Said]:
    frame = socket.recv(timeout=LONGEST)
    assert isinstance(frame, bytes)
    return messages_in(frame)


def test_a_browser_that_stops_reading_sees_the_present_when_it_goes_on_and_holds_up_no_other(watched: Watched) -> None:
    with slow_browser(watched) as socket:
        before = watched.page.said["SetOrientationMessage"]
        watched.draw(PICTURES)
        assert until(lambda: watched.page.said["SetOrientationMessage"] > before + PICTURES / 2)
        kept = watched.buffered()
        watched.draw(PICTURES)
        assert watched.buffered() <= kept + 1  # the newest of each thing, however long it takes
        assert kept < PICTURES / 2
        seen: list[int] = []
        while watched.drawn not in seen:
            seen += watched.pictures_in(messages_of(socket))
        assert len(seen) <= UNDER_WAY
