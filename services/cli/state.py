"""`gemelo state`: the joints, the tool, the steps, and the device, at one glance."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import msgspec

from schemas.topics import DEVICE_STATE, DEVICE_STATUS, FRAMES, JOINT_STATES, STATIC_FRAMES, STEP_ERRORS
from services.cli.exits import CommandError, ExitCode
from services.cli.snapshot import Snapshot, snapshot, text_of

if TYPE_CHECKING:
    from services.cli.session import Session

PATIENCE = 2.0  # [s] for the first messages
REFRESH = 0.2  # [s] of --watch


class StateView:
    """Collects the newest of every message that a snapshot needs."""

    def __init__(self, session: Session) -> None:
        from services.arm.frames import FrameBuffer

        self._arm = session.arm
        node = session.node
        self.frames = FrameBuffer()
        self._states = node.latest(JOINT_STATES)
        self._errors = node.latest(STEP_ERRORS)
        self._device = node.latest(DEVICE_STATE)
        self._status = node.latest(DEVICE_STATUS)
        node.subscribe(FRAMES, self.frames.insert_all)
        node.subscribe(STATIC_FRAMES, lambda message: self.frames.insert_all(message, is_static=True))

    @property
    def is_complete(self) -> bool:
        parts = (self._states.message, self._errors.message, self._device.message, self._status.message)
        return None not in parts and self.tool() is not None

    @property
    def is_empty(self) -> bool:
        return self._states.message is None and self._status.message is None

    def tool(self) -> tuple[float, ...] | None:
        """Where the tool is in the base frame [m], by the frames that the state_publisher says."""
        from services.arm.frames import FrameError

        try:
            return tuple(self.frames.look_up(self._arm.base_frame, self._arm.tool_frame).translation)
        except FrameError:
            return None

    def snapshot(self) -> Snapshot:
        return snapshot(
            self._arm,
            self._states.message,
            self._errors.message,
            self._device.message,
            self._status.message,
            self.tool(),
        )


def state(session: Session, watch: bool, as_json: bool) -> ExitCode:
    """Prints one snapshot, or one after another until Ctrl-C."""
    view = StateView(session)
    wait_for(session, view)
    if not watch:
        print(_render(view, as_json))
        return ExitCode.OK
    return _watch(session, view, as_json)


def wait_for(session: Session, view: StateView) -> None:
    """Handles messages until all have come, or `PATIENCE` is over; nothing at all is an error."""
    deadline = session.node.monotonic() + PATIENCE
    while not view.is_complete and session.node.monotonic() < deadline:
        session.node.wait(0.02)
    if view.is_empty:
        raise CommandError(
            f"nothing heard of the arm in {PATIENCE:g} s: is stepper_gateway running? `gemelo node list`",
            ExitCode.NO_STACK,
        )


def _render(view: StateView, as_json: bool) -> str:
    shown = view.snapshot()
    return msgspec.json.encode(shown).decode() if as_json else text_of(shown)


def _watch(session: Session, view: StateView, as_json: bool) -> ExitCode:
    clear = "\x1b[H\x1b[2J" if sys.stdout.isatty() and not as_json else ""

    def step(now: int) -> None:
        print(clear + _render(view, as_json), flush=True)

    session.node.spin(step, rate=1.0 / REFRESH)
    return ExitCode.OK
