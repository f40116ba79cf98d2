"""The moments for which a black box is saved: faults, emergency stops, reboots, aborts, lost services. Pure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from gemelo.libraries.recordings.incidents import IncidentKind
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceEvent, DeviceFault, DeviceMode, DeviceState
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.roles import SERVICES
from gemelo.schemas.system import NodeStatistics
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, Topic

STOPPED = (DeviceMode.FAULT, DeviceMode.ESTOP)
ENDED = keys.ended_topic(FOLLOW_JOINT_TRAJECTORY).key
SILENT_AFTER = 4_000_000_000  # [ns] without statistics, which come every second
HEARD_LATELY = 2_000_000_000  # [ns] in which another node must have spoken: else it is we who did not listen
SHORT = 8  # letters of a goal's id, by which a person knows it
LONG_AGO = 30_000_000_000  # [ns] a start of before that was by another clock than ours
WATCHED = frozenset(SERVICES) - {"logger"}  # whose own statistics are heard whatever has happened to all others


@dataclass(frozen=True)
class Trigger:
    """Why a black box is saved; `stamp` in [ns] UNIX."""

    kind: IncidentKind
    stamp: int
    what: Reason  # one clause for a person
    joint: str = ""  # whose fault it is, where that is known


@dataclass
class IncidentWatch:
    """Looks at every message; a device that is stopped when it is first heard has stopped before our time."""

    _mode: DeviceMode | None = field(default=None, init=False)
    _heard: dict[str, int] = field(default_factory=dict, init=False)  # [ns] arrival of each service's statistics
    _started: dict[str, int] = field(default_factory=dict, init=False)  # [ns] UNIX start of each service
    _newest: int = field(default=0, init=False)  # [ns] arrival of anybody's
    _router: str = field(default="", init=False)  # that was connected last
    _routed: int = field(default=0, init=False)  # [ns] when it was seen last
    _unlinked: Trigger | None = field(default=None, init=False)  # the gateway has no link to the device

    def on_message(self, topic: Topic[Any], message: Message, now: int) -> Trigger | None:
        """The trigger that `message` is, which came at `now` [ns] UNIX."""
        match message:
            case DeviceState():
                return self._on_state(message, now)
            case DeviceEvent(event="rebooted"):
                return Trigger(IncidentKind.REBOOT, now, because("incident.rebooted", _detail(message)))
            case DeviceEvent(event="disconnected"):
                self._unlinked = Trigger(IncidentKind.LOST, now, because("incident.unlinked", _detail(message)))
            case DeviceEvent(event="connected"):
                return self._take_unlinked()
            case NodeStatistics(node=node) if node != "logger":
                self._on_anybody(now)
                return self._on_statistics(message, now) if node in WATCHED else None
        if topic.key == ENDED and (aborted := _on_ended(message, now)) is not None:
            self._unlinked = None  # the abort says it
            return aborted
        return None

    def on_router(self, router: str, now: int) -> Trigger | None:
        """The trigger where the router was started again: all were silent, and none of them has failed."""
        if not router:
            return None
        before, since, self._router, self._routed = self._router, self._routed, router, now
        if before in ("", router):
            return None
        what = because("incident.router", silence=(now - since) / 1e9)
        return Trigger(IncidentKind.LOST, max(since, now - LONG_AGO), what)

    def step(self, now: int) -> Trigger | None:
        """The trigger that a silence is; `now` in [ns] UNIX."""
        if now - self._newest > HEARD_LATELY:
            return None
        if self._unlinked is not None and now - self._unlinked.stamp > SILENT_AFTER:
            return self._take_unlinked()
        for node, heard in self._heard.items():
            if now - heard > SILENT_AFTER:
                del self._heard[node]
                what = because("incident.silent", node=node, silence=(now - heard) / 1e9)
                return Trigger(IncidentKind.LOST, now, what)
        return None

    def _take_unlinked(self) -> Trigger | None:
        """A link that was lost: told when it is back, or stays away, but not where the whole twin ends."""
        trigger, self._unlinked = self._unlinked, None
        return trigger

    def _on_anybody(self, now: int) -> None:
        """After a time in which nobody was heard each has its time anew to be back."""
        if now - self._newest > HEARD_LATELY:
            self._heard = dict.fromkeys(self._heard, now)
        self._newest = now

    def _on_statistics(self, message: NodeStatistics, now: int) -> Trigger | None:
        """The trigger where a service was started again before its silence was noticed."""
        node, started = message.node, message.started
        was_heard = node in self._heard
        self._heard[node] = now
        before, self._started[node] = self._started.get(node), started
        if not was_heard or before == started:  # a silence that was told already is no second incident
            return None
        stamp = min(max(started, now - LONG_AGO), now)
        return Trigger(IncidentKind.LOST, stamp, because("incident.restarted", node=node))

    def _on_state(self, state: DeviceState, now: int) -> Trigger | None:
        before, self._mode = self._mode, state.mode
        if before is None or before in STOPPED or state.mode not in STOPPED:
            return None
        if state.mode is DeviceMode.ESTOP or state.fault == DeviceFault.EMERGENCY_STOP:
            return Trigger(IncidentKind.EMERGENCY_STOP, now, because("incident.emergency_stop"))
        what = fault_reason(state.fault, state.fault_joint) or because("incident.fault")
        return Trigger(IncidentKind.FAULT, now, what, state.fault_joint)


def _on_ended(end: Any, now: int) -> Trigger | None:
    """`end` is a `GoalEnd` with a typed result; one that was cancelled, or made room for another, is no incident."""
    if end.status is not GoalStatusCode.ABORTED:
        return None
    why = why_of_end(end) or because("ended.unexplained")
    return Trigger(IncidentKind.ABORT, now, because("incident.aborted", why, goal=end.goal_id[:SHORT]))


def why_of_end(end: Any) -> Reason | None:
    """Of a `GoalEnd` with a typed result; None where it does not say why."""
    return reason_of(getattr(end.result, "error_string", ""), getattr(end.result, "why", None))


def reason_of(text: str, why: Reason | None) -> Reason | None:
    """`why`; the sentence alone, as an older program sends it; None where there is neither."""
    return why or (plain(text) if text else None)


def _detail(event: DeviceEvent) -> Reason:
    return event.why or plain(event.detail)
