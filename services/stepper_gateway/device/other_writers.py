"""Other writers under the device's name: a second device, or a program that is none.

A second device sends states of another boot beside those of the present one, and goes on. A device that restarts has
another boot too, but then the old one's states end within a network's delay. One frame, or old ones that come again in
a heap, may be anybody's: a device's states go on at the pace of its clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from gemelo.schemas.reasons import Reason, because, plain
from gemelo.services.stepper_gateway.links.frames import NoFrame, StateFrame
from gemelo.services.stepper_gateway.links.reports import StatusReport

ENOUGH = 8  # states of another boot, each after one of the present one; chosen: 0.15 s, a forger sends single ones
SAME_PACE = 0.1  # [s] by which the device's clock and ours may part within a row; chosen: a network's jitter
PRESENT = 1.5  # [s] after its last state, in which a second device counts as there; chosen: some states may be late
MOST_OTHERS = 4  # boots whose rows are kept; chosen: more boards of one name than a person has
STRANGE = 5  # messages that are no frames, within STRANGE_SPAN; chosen: more than a garbled one now and then
STRANGE_SPAN = 10.0  # [s] chosen: a sketch of one message in two seconds is one


@dataclass
class _Row:
    """States of one boot that go on at the pace of its clock; times in [s]."""

    began: float  # monotonic, of the first
    clock: float  # of the device at that
    newest: float  # of the device
    counted: float  # monotonic, of the last that was counted
    count: int = 1

    def takes(self, clock: float, arrival: float) -> bool:
        """True if a state of `clock` that came at `arrival` goes on with the row."""
        parted = abs((clock - self.clock) - (arrival - self.began))
        return clock > self.newest and parted < SAME_PACE


class OtherBoots:
    """The boots that send states beside the present one."""

    def __init__(self) -> None:
        self._rows: dict[int, _Row] = {}
        self._seen: dict[int, float] = {}  # [s] monotonic, of the newest state of a boot that is certain

    def on_state(self, state: StateFrame, arrival: float, present: float) -> None:
        """A state of another boot than the present one, whose last came at `present`; both in [s] monotonic.

        Only what comes between states of the present one counts: else one of the two has just ended.
        """
        clock = state.t_us * 1e-6
        row = self._rows.pop(state.boot_id, None)
        if row is None or not row.takes(clock, arrival):
            row = _Row(arrival, clock, clock, arrival)
        elif present > row.counted:
            row.count, row.newest, row.counted = row.count + 1, clock, arrival
        self._rows[state.boot_id] = row
        if len(self._rows) > MOST_OTHERS:
            del self._rows[next(iter(self._rows))]
        if row.count >= ENOUGH:
            self._seen[state.boot_id] = arrival
            self._seen = dict(sorted(self._seen.items(), key=lambda one: one[1])[-MOST_OTHERS:])

    def forget(self, boot_id: int) -> None:
        """That boot is the present one from now on."""
        self._rows.pop(boot_id, None)
        self._seen.pop(boot_id, None)

    def living(self, now: float) -> tuple[int, ...]:
        """The boots of which a device sends states at `now` [s] monotonic, beside the present one."""
        if not self._seen:
            return ()
        return tuple(boot for boot, at in sorted(self._seen.items()) if now - at <= PRESENT)


class Strangers:
    """Messages under the device's topics that are no frames of gemelo at all, as those of an old sketch."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._arrivals: deque[float] = deque(maxlen=STRANGE)  # [s] monotonic
        self._reason: Reason | None = None

    def on_message(self, kind: str, error: NoFrame, now: float) -> None:
        """One of `kind` at `now` [s] monotonic; `error` says why it is no frame."""
        if self.reason(now) is None:
            self._reason = because("device.strangers", plain(str(error)), device=self._device, kind=kind)
        self._arrivals.append(now)

    def reason(self, now: float) -> Reason | None:
        """That there are some at `now` [s] monotonic; the same as long as it goes on."""
        is_there = len(self._arrivals) == STRANGE and now - self._arrivals[0] <= STRANGE_SPAN
        return self._reason if is_there else None


def boot_reason(boot_id: int, report: StatusReport | None) -> Reason:
    """`boot 05b8fac7 (virtual, firmware 1.0.0, process 12 on workshop)`, as far as it is known."""
    boot = f"{boot_id:08x}"
    if report is None:
        return because("device.boot", boot=boot)
    kind = "virtual" if report.virtual else "board"
    if report.place:
        return because("device.boot.placed", boot=boot, kind=kind, firmware=report.firmware, place=report.place)
    return because("device.boot.reported", boot=boot, kind=kind, firmware=report.firmware)
