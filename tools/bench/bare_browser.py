"""A browser of the operator's page that draws nothing: it speaks viser's protocol, reads all that is sent and drops it.

What it measures is the page's own: a real browser without a graphics card takes most of a machine.
"""

from __future__ import annotations

import html
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Subprotocol

from gemelo.services.panel.view.browser import CHANNEL

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (1.0, 1.0, 1.0), "fov": 1.0, "near": 0.1,
    "far": 100.0, "image_height": 720, "image_width": 840, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip
LENGTHS = 16  # [bytes] before the compressed part of a frame: its length decompressed, and compressed
TAG = re.compile(r"<[^>]*>")
MARK = re.compile(r'data-gemelo-sent="(\d+)"')
PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")
Said = dict[str, Any]  # one message of viser's, as its fields by name; "type" is its class
PATIENCE = 30.0  # [s]


class BareBrowser:
    """Hears in a thread of its own; `on_said` is called there with each message and when it came, [s] monotonic."""

    def __init__(self, socket: Connection, on_said: Callable[[Said, float], object]) -> None:
        self._socket, self._on_said = socket, on_said
        self._news = threading.Condition()
        self._labels: dict[str, str] = {}  # of buttons, by their number
        self._sliders: dict[str, str] = {}  # labels of sliders, by their number
        self._choices: dict[str, str] = {}  # labels of drop-downs and checkboxes, by their number
        self._texts: dict[str, str] = {}  # HTML, by its number
        self._channel, self._answered = "", ""  # the number of the hidden field, and the newest mark that was answered
        self.frames = 0
        socket.send(msgspec.msgpack.encode(CAMERA))  # with its first camera a browser is there
        threading.Thread(target=self._hear, daemon=True, name="bare browser").start()

    @property
    def labels(self) -> set[str]:
        """Of all buttons."""
        with self._news:
            return set(self._labels.values())

    @property
    def texts(self) -> list[str]:
        """All lines of the page that say something: how the arm is first, then the newest problem, if there is one."""
        with self._news:
            plain = [" ".join(TAG.sub(" ", text).split()) for text in self._texts.values()]
        return [html.unescape(text) for text in plain if text]

    def wait_for(self, label: str) -> None:
        """Returns once the page has a button whose label begins so; raises TimeoutError if it has none."""
        self._button(label)

    def press(self, label: str) -> None:
        """Presses the newest button whose label begins so, once the page has it; raises TimeoutError if it has none."""
        self._set(self._button(label), True)

    def press_exactly(self, label: str, place: int = -1) -> None:
        """Presses the newest button of exactly that label, or that at `place` of all of them, the oldest first."""
        with self._news:
            numbers = [number for number, text in self._labels.items() if text == label]
        self._set(numbers[place], True)

    def hold(self, label: str, rate: float) -> None:
        """Says once, as it would `rate` [Hz] times while it is held, that the newest button whose label begins so is
        held; raises TimeoutError if the page has none."""
        said = {"type": "GuiButtonHoldMessage", "uuid": self._button(label), "frequency": rate}
        self._socket.send(msgspec.msgpack.encode(said))

    def choose(self, label: str, value: str | bool) -> None:
        """Sets the newest drop-down or checkbox whose label begins so; raises TimeoutError if there is none."""
        self._set(self._newest(self._choices, label, "choice"), value)

    def slide(self, label: str, value: float) -> None:
        """Sets the newest slider whose label begins so, in the unit of its label; raises TimeoutError if there is
        none."""
        self._set(self._newest(self._sliders, label, "slider"), value)

    def _set(self, number: str, value: object) -> None:
        said = {"type": "GuiUpdateMessage", "uuid": number, "updates": {"value": value}}
        self._socket.send(msgspec.msgpack.encode(said))

    def _button(self, label: str) -> str:
        return self._newest(self._labels, label, "button")

    def _newest(self, labels: dict[str, str], label: str, kind: str) -> str:
        """The number of the newest one whose label begins so, once the page has it."""

        def found() -> str:
            return next((number for number, text in reversed(labels.items()) if text.startswith(label)), "")

        with self._news:
            if not self._news.wait_for(found, PATIENCE):
                raise TimeoutError(f'the page has no {kind} "{label}" after {PATIENCE:g} s')
            return found()

    def _hear(self) -> None:
        with suppress(ConnectionClosed):
            for frame in self._socket:
                now = time.monotonic()
                assert isinstance(frame, bytes)
                self.frames += 1
                for said in messages_in(frame):
                    self._note(said)
                    self._on_said(said, now)

    def _note(self, said: Said) -> None:
        """Remembers what can be pressed and set, and answers marks as the page's script does."""
        labels = {
            "GuiButtonMessage": self._labels, "GuiSliderMessage": self._sliders,
            "GuiDropdownMessage": self._choices, "GuiCheckboxMessage": self._choices,
        }.get(said["type"])  # fmt: skip
        if labels is not None:
            with self._news:
                labels[said["uuid"]] = str(said["props"]["label"])
                self._news.notify_all()
        elif said["type"] == "GuiTextMessage" and said["value"].startswith(CHANNEL):
            self._channel = said["uuid"]
        content = (said.get("props") or said.get("updates") or {}).get("content")
        if said["type"] == "GuiRemoveMessage":
            self._texts.pop(said["uuid"], None)
        elif content is not None and "uuid" in said:
            with self._news:
                self._texts[said["uuid"]] = str(content)
        found = MARK.search(str(content))
        if found and self._channel and found[1] != self._answered:
            self._answered = found[1]
            self._set(self._channel, f'{CHANNEL} {{"sent": {found[1]}, "language": "en", "rate": 60.0}}')


def messages_in(frame: bytes) -> list[Said]:
    """What viser has sent with one frame, without the arrays that follow it."""
    length, packed = (int.from_bytes(frame[at : at + 8], "little") for at in (0, 8))
    text = zstandard.ZstdDecompressor().decompress(frame[LENGTHS : LENGTHS + packed], max_output_size=length)
    messages: list[Said] = msgspec.msgpack.decode(text)["messages"]
    return messages


@contextmanager
def bare_browser(address: str, on_said: Callable[[Said, float], object]) -> Iterator[BareBrowser]:
    """One at the page at `address`, host and port; `on_said` gets each message and its arrival [s] monotonic."""
    with connect(f"ws://{address}", subprotocols=[PROTOCOL], max_size=None) as socket:
        yield BareBrowser(socket, on_said)
