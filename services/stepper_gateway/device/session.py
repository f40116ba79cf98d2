"""The device as known through its link: who it is, which boot, how it is, what time it has, whether it is there."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.device.other_writers import OtherBoots, boot_reason
from gemelo.services.stepper_gateway.device.questions import Questions
from gemelo.services.stepper_gateway.device.state_checks import StateChecks
from gemelo.services.stepper_gateway.links.frames import (
    NEVER_EXPIRES,
    BadFrame,
    Code,
    CommandFrame,
    CommandReply,
    Frame,
    Heartbeat,
    StateFlag,
    StateFrame,
    Sync,
    SyncReply,
)
from gemelo.services.stepper_gateway.links.reports import StatusReport
from gemelo.services.stepper_gateway.moment import Moment, next_beat

HEARTBEAT = 0.1  # [s] chosen: a cut of 0.4 s does not stop the arm yet
SYNC = 0.5  # [s] chosen: a crystal's drift in that time is 50 us at most
SYNC_AT_FIRST = 0.03  # [s] until the clock is known; chosen: the three that are needed take 0.1 s
SYNC_UNANSWERED = 0.1  # [s] chosen: twelve questions are lost before the device counts as deaf
STEADY_BEATS = 0.7  # [s] of heartbeats without a pause, after which a device has heard one; chosen: above its 0.5 s
ASK_STATUS = 1.0  # [s] between two requests for a status that is missing; chosen: a slow network answers by then
# Chosen: true states are not taken until they are newer than one from so far ahead, which must not look like silence.
FARTHEST_AHEAD = 0.2  # [s] that a frame's time may be ahead of the device's clock as it is known
NUMBERS = {2: "two", 3: "three"}
MODES = {mode.value: mode for mode in DeviceMode}
OLD_BOOTS = 16  # remembered, so that a late frame of one is no reboot; chosen: more than a broker keeps frames of


class DeviceSession:
    """What is known of one device; refuses what belongs to another boot or comes out of order.

    Only states tell which boot lives: a status or a last will may be old.
    """

    def __init__(self, device: str, joints: int, session_id: int) -> None:
        self._device = device
        self._joints = joints
        self._session_id = session_id
        self._counter = 0
        self._heartbeat_due = self._sync_due = 0.0
        self._beat = self._beats_since = -1.0e9  # [s] monotonic, of the last one, and of the first without a pause
        self._status_due = 0.0  # [s] monotonic
        self._status_id = session_id ^ 0x80000000  # far from those of a person's commands
        self._tells_status = True  # on request
        self._old_boots: list[int] = []
        self._reports: dict[int, StatusReport] = {}  # by boot id
        self._doubted: StatusReport | None = None  # contradicts what the present boot has said; it is asked again
        self._checks, self._others = StateChecks(), OtherBoots()
        self._offline_boot = 0  # whose last will has come
        self._questions = Questions()
        self.link_up = False
        self.link_reason = because("link.none_yet")
        self.latest: StateFrame | None = None  # of any number of joints
        self.state: StateFrame | None = None  # the latest, if it is one of this arm
        self.state_arrival = -1.0e9  # [s] monotonic
        self.boot_id = 0
        self.status: StatusReport | None = None  # what the present boot has said about itself
        self.clock = ClockSync()

    @property
    def is_open_loop(self) -> bool:
        """True if the device does not say what it has executed: its steps are those that were sent."""
        return self.status is not None and self.status.open_loop

    @property
    def is_armed(self) -> bool:
        """True if the drivers are energised."""
        return self.latest is not None and bool(self.latest.flags & StateFlag.ARMED)

    def fits(self, state: StateFrame) -> bool:
        """True if the state has this arm's joints; a device with another configuration has others."""
        return len(state.steps) == self._joints

    def on_link(self, connected: bool, reason: Reason) -> None:
        self.link_up, self.link_reason = connected, reason
        if connected:
            self._heartbeat_due = self._sync_due = 0.0
            self._questions.begin_anew()
        else:
            self.state_arrival = -1.0e9

    def on_status(self, status: StatusReport) -> None:
        """Take what a boot says about itself, or its last will."""
        if not status.online:
            self._offline_boot = status.boot_id
            return
        if status.boot_id == self._offline_boot:
            self._offline_boot = 0
        if self._is_doubtful(status):
            self._doubted, self._status_due = status, 0.0
        else:
            self._believe(status)

    def _is_doubtful(self, status: StatusReport) -> bool:
        """True for what the present boot has not said before, until it says so twice: anybody may have written it."""
        known = self.status if status.boot_id == self.boot_id else None
        if known is None or not self._tells_status or _facts(status) == _facts(known):
            return False
        return self._doubted is None or _facts(status) != _facts(self._doubted)

    def _believe(self, status: StatusReport) -> None:
        if status.boot_id == self.boot_id:
            self._doubted = None
        self._reports[status.boot_id] = status
        if len(self._reports) > OLD_BOOTS:
            del self._reports[next(boot for boot in self._reports if boot != self.boot_id)]
        self.status = self._reports.get(self.boot_id)

    def on_state(self, state: StateFrame, arrival: float, timeout: float) -> tuple[bool, bool]:
        """(is it news, does it tell of a new boot); raises `BadFrame` for one that no device says.

        `arrival` [s] monotonic; states older than `timeout` [s] count as a pause.
        """
        if state.mode not in MODES:
            raise BadFrame(f"a state with the unknown mode {state.mode}")
        is_fresh = arrival - self.state_arrival <= timeout
        if is_fresh and state.boot_id == self.boot_id:
            self.require_present(state, state.t_us, arrival)
            self._checks.require_steady(self.latest, state)
        elif is_fresh and self.latest is not None:
            self._others.on_state(state, arrival, self.state_arrival)
            if state.boot_id in self._old_boots or state.boot_id in self._others.living(arrival):
                return False, False
            self._checks.require_in_a_row(self.latest, state)
        is_new_boot = self._meet(state.boot_id)
        if self.latest is not None and state.t_us <= self.latest.t_us and is_fresh:
            return False, is_new_boot
        self.latest, self.state_arrival = state, arrival
        self.state = state if self.fits(state) else None
        return True, is_new_boot

    def question(self, moment: Moment) -> Sync:
        """One more question for the clock, now."""
        return self._questions.ask(self.boot_id, moment)

    def on_sync_reply(self, reply: SyncReply, arrival_us: int) -> None:
        """Take an answer to a question of ours; raises `BadFrame` for one that is not believed."""
        self.require_known(reply)
        if reply.boot_id != self.boot_id or not self._questions.is_open(reply, arrival_us):
            return
        if not self.clock.add(reply.t0, reply.t1, reply.t2, arrival_us):  # the question stays open for the true answer
            raise BadFrame(f"an answer of {reply.t1} us, which is not the device's clock as it is known")
        self._questions.on_answer(reply.t0, arrival_us)

    def require_known(self, frame: Frame) -> None:
        """Raises `BadFrame` for a frame of a boot that has never been heard."""
        if self.boot_id and frame.boot_id not in (self.boot_id, *self._old_boots):
            raise BadFrame(f"it comes from boot {frame.boot_id}, while boot {self.boot_id} lives")

    def require_present(self, frame: Frame, t_us: int, arrival: float) -> None:
        """Raises `BadFrame` for a frame of the present boot that was said at `t_us` [us] and came before that [s]."""
        if frame.boot_id != self.boot_id or not self.clock.is_synchronised:
            return
        ahead = t_us * 1e-6 - self.clock.device_time(arrival) * 1e-6
        if ahead > FARTHEST_AHEAD + self.clock.round_trip:
            raise BadFrame(f"it comes from {ahead:.1f} s ahead of the device's clock")

    def on_reply(self, reply: CommandReply) -> None:
        """A device with an older firmware cannot be asked for its status."""
        if (reply.boot_id, reply.cmd, reply.code) == (self.boot_id, DeviceCommandKind.STATUS, Code.UNKNOWN_CMD):
            self._tells_status = False
            if self._doubted is not None:
                self._believe(self._doubted)

    def renew_heartbeat(self, moment: Moment) -> bool:
        """A fresh heartbeat session, where the device misses beats that have been sent; true if so."""
        if self._beat - self._beats_since < STEADY_BEATS or moment.monotonic - self._beat > 2.0 * HEARTBEAT:
            return False
        self._session_id = self._session_id % 0xFFFFFFFF + 1
        self._counter = 0
        self._heartbeat_due, self._beats_since = 0.0, moment.monotonic
        return True

    def due(self, moment: Moment) -> list[Heartbeat | Sync | CommandFrame]:
        """Heartbeat, clock and status frames to send now; called by the control loop itself."""
        frames: list[Heartbeat | Sync | CommandFrame] = []
        if not self.link_up:
            return frames
        if moment.monotonic >= self._heartbeat_due:
            self._heartbeat_due = next_beat(self._heartbeat_due, moment.monotonic, HEARTBEAT)
            self._counter = (self._counter + 1) & 0xFFFFFFFF
            if moment.monotonic - self._beat > 2.0 * HEARTBEAT:
                self._beats_since = moment.monotonic
            self._beat = moment.monotonic
            frames.append(Heartbeat(boot_id=self.boot_id, session=self._session_id, counter=self._counter))
        if moment.monotonic >= self._sync_due:
            self._sync_due = next_beat(self._sync_due, moment.monotonic, self._sync_period(moment))
            frames.append(self.question(moment))
        if self._lacks_status(moment) and moment.monotonic >= self._status_due:
            self._status_due = moment.monotonic + ASK_STATUS
            self._status_id = (self._status_id + 1) & 0xFFFFFFFF
            kind = DeviceCommandKind.STATUS
            frames.append(
                CommandFrame(boot_id=self.boot_id, cmd_id=self._status_id, expires_us=NEVER_EXPIRES, cmd=kind)
            )
        return frames

    def _sync_period(self, moment: Moment) -> float:
        """[s] until the next question for the clock."""
        if not self.clock.is_synchronised or self.clock.is_contradicted:
            return SYNC_AT_FIRST
        return SYNC_UNANSWERED if self._questions.is_late(moment.monotonic) else SYNC

    def second_device(self, moment: Moment) -> Reason | None:
        """That another device is there under this one's name."""
        others = self._others.living(moment.monotonic)
        if not others:
            return None
        known = (boot_reason(boot, self._reports.get(boot)) for boot in (self.boot_id, *others))
        number = NUMBERS.get(len(others) + 1, "several")
        return because("device.several", *known, device=self._device, number=number)

    def deaf_since(self, moment: Moment, timeout: float) -> int:
        """[ns] UNIX time since when the device does not hear; 0 while it hears, is silent, or is one of two."""
        is_known = self.is_fresh(moment, timeout) and not self.second_device(moment)
        return self._questions.deaf_since(moment) if is_known else 0

    @property
    def unanswered_for(self) -> float:
        """[s] since the device has answered a question, when its newest state came; 0 before its first answer."""
        return max(0.0, self.state_arrival - self._questions.answered) if self.clock.exchanges else 0.0

    def _lacks_status(self, moment: Moment) -> bool:
        is_wanted = self.status is None or self._doubted is not None
        return self._tells_status and is_wanted and self.boot_id != 0 and self.is_fresh(moment, ASK_STATUS)

    @property
    def last_beat(self) -> float:
        """[s] monotonic, when the last heartbeat was sent."""
        return self._beat

    def is_fresh(self, moment: Moment, timeout: float) -> bool:
        """True if a state has arrived within `timeout` [s]."""
        return self.link_up and moment.monotonic - self.state_arrival <= timeout

    @property
    def mode(self) -> DeviceMode:
        return MODES[self.latest.mode] if self.latest is not None else DeviceMode.BOOT

    def unreachable_reason(self, moment: Moment, timeout: float) -> Reason | None:
        """Why the device cannot be reached: no link, no state for `timeout` [s], a second device, no answer, or
        another gateway; None if it can."""
        name = self._device
        if not self.link_up:
            return because("device.no_link", self.link_reason, device=name)
        if not self.is_fresh(moment, timeout):
            if self._offline_boot and self.boot_id in (0, self._offline_boot):
                return because("device.offline", device=name)
            if self.latest is None and not self._reports:
                return because("device.never_received", device=name)
            return because("device.silent", device=name, time=timeout)
        if second := self.second_device(moment):
            return second
        if self._questions.is_deaf(moment.monotonic):
            return because("device.deaf", device=name)
        if self._questions.has_twin(moment.monotonic):
            return because("device.second_gateway", device=name)
        if self.status is None:
            return because("device.unidentified", device=name)
        if not self.clock.is_synchronised:
            return because("device.clock_unknown", device=name)
        return None

    def _meet(self, boot_id: int) -> bool:
        """Adopt a boot id; true if it replaces another one."""
        if boot_id == self.boot_id:
            return False
        is_reboot = self.boot_id != 0
        if is_reboot:
            self._old_boots = [*self._old_boots[1 - OLD_BOOTS :], self.boot_id]
        self._old_boots = [boot for boot in self._old_boots if boot != boot_id]
        self._others.forget(boot_id)
        self.boot_id, self.status = boot_id, self._reports.get(boot_id)
        self.latest = self.state = None
        self._doubted, self._checks = None, StateChecks()
        self.clock.reset()
        self._sync_due = 0.0
        self._questions.begin_anew()
        self._status_due, self._tells_status = 0.0, True
        return is_reboot


def _facts(status: StatusReport) -> StatusReport:
    """What a boot never changes, but for another configuration."""
    return replace(status, referenced=False, armed=False, heap_free=0, heap_least=0, stack_least=0, stack_task="")
