"""`gemelo device monitor`: a line for everything that changes, and on a terminal the device as it is below."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceConfiguration, DeviceState, DeviceStatus
from schemas.topics import DEVICE_CONFIGURATION, DEVICE_EVENTS, DEVICE_STATE, DEVICE_STATUS
from services.cli.device_changes import configuration_changes, event_text, state_changes, status_changes
from services.cli.device_status import snapshot_of
from services.cli.device_text import text_of
from services.cli.device_view import DeviceView
from services.cli.exits import ExitCode
from services.cli.live import LiveBlock

if TYPE_CHECKING:
    from services.cli.session import Session

REFRESH = 5.0  # [Hz]


class Change(msgspec.Struct, frozen=True):
    """A line of `--json`."""

    stamp: int  # [ns] UNIX time of hearing it
    text: str


class Monitor:
    """Says every change once, at most `count` of them."""

    def __init__(self, session: Session, block: LiveBlock, count: int | None, as_json: bool) -> None:
        self._session, self._block, self._count, self._as_json = session, block, count, as_json
        self._status: DeviceStatus | None = None
        self._state: DeviceState | None = None
        self._configuration: DeviceConfiguration | None = None
        self._said = 0
        node = session.node
        node.subscribe(DEVICE_STATUS, self._on_status)
        node.subscribe(DEVICE_CONFIGURATION, self._on_configuration)
        node.subscribe(DEVICE_EVENTS, lambda event: self._say([event_text(event)]))
        node.subscribe(DEVICE_STATE, self._on_state)

    def _on_status(self, status: DeviceStatus) -> None:
        before, self._status = self._status, status
        self._say(status_changes(before, status))

    def _on_configuration(self, configuration: DeviceConfiguration) -> None:
        before, self._configuration = self._configuration, configuration
        self._say(configuration_changes(before, configuration))

    def _on_state(self, state: DeviceState) -> None:
        before, self._state = self._state, state
        self._say(state_changes(self._session.arm, before, state))

    def _say(self, lines: list[str]) -> None:
        now = self._session.node.now()
        for line in lines:
            if self._count is not None and self._said >= self._count:
                return
            self._said += 1
            self._block.say(msgspec.json.encode(Change(now, line)).decode() if self._as_json else _timed(now, line))
        if self._count is not None and self._said >= self._count:
            self._session.node.stop()


def monitor(session: Session, count: int | None, duration: float | None, as_json: bool) -> ExitCode:
    """Runs until Ctrl-C, `count` lines or `duration` [s]."""
    block = LiveBlock(is_live=False) if as_json else LiveBlock()
    view = DeviceView(session)
    Monitor(session, block, count, as_json)
    ends = None if duration is None else session.node.monotonic() + duration

    def step(now: int) -> None:
        block.draw("\n" + text_of(snapshot_of(view)))
        if ends is not None and session.node.monotonic() >= ends:
            session.node.stop()

    session.node.spin(step, rate=REFRESH)
    return ExitCode.OK


def _timed(now: int, line: str) -> str:
    time = datetime.datetime.fromtimestamp(now / 1e9).strftime("%H:%M:%S.%f")[:-3]
    return f"{time} {line}"
