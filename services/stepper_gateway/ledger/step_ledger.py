"""The ledger of one device: evidence per joint from states and events, the message of it, and what is to be kept."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.tool_jacobian import ToolJacobian
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.ledger import StepLedger, VerifiedBy
from gemelo.schemas.topics import STEP_LEDGER
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.ledger.confidence import (
    LATE,
    REBOOT,
    REST_FAULT,
    Evidence,
    LedgerRecord,
    after_verification,
    confidence,
    doubt,
    open_loop_reason,
)
from gemelo.services.stepper_gateway.ledger.joint_watch import JointSample, JointWatch
from gemelo.services.stepper_gateway.ledger.tool_error import bounds, known_shift, tool_shift
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.links.reports import EventReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knots import whole_steps
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.outputs import KeepLedger

LEVEL = 0.95  # of the bounds that are told; chosen: the usual one of statistics
PERIOD = 1.0 / (STEP_LEDGER.rate or 5.0)  # [s]
KEEP_EVERY = 5.0  # [s] between two writes while something changes; chosen: spares the disk, and little is lost
KEEP_SOON = 1.0  # [s] the same where a motion has begun or ended, or a joint was verified; chosen: seldom enough
SWITCHED = ("homed", "passed")  # events that tell of a switch


@dataclass
class JointRow:
    """One joint in the ledger."""

    watch: JointWatch
    evidence: Evidence
    sample: JointSample | None = None  # of the last state; None: the next one is where it begins
    verified_us: int = 0  # device time of the last verification: older states say nothing about it
    is_referenced: bool = False


class LedgerKeeper:
    """Pure: takes states and events of one device, with the moment, and puts messages and records out."""

    def __init__(self, device: GatewayDevice, kept: LedgerRecord | None) -> None:
        self._device, self._kept = device, kept
        self._rows = [JointRow(JointWatch(joint), Evidence()) for joint in device.joints]
        self._jacobian = ToolJacobian(device.arm)
        self._identity: tuple[bool, int] | None = None  # virtual, configuration
        self._boot = 0
        self._is_moving = False
        self._point: PathPoint | None = None
        self._told = self._written = -1.0e9  # [s] monotonic
        self._last: LedgerRecord | None = None  # that was written

    def on_state(self, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        """The device's word on every joint; nothing before it has said who it is."""
        status = self._device.session.status
        if status is None or status.open_loop:
            return
        self._meet((status.virtual, status.config_crc32), state)
        self._point = point
        self._is_moving = state.mode == DeviceMode.HOMING or any(abs(rate) >= 1.0 for rate in state.velocity)
        for index, row in enumerate(self._rows):
            self._account(row, JointSample(state.t_us, state.steps[index], state.velocity[index]))
            if state.t_us >= row.verified_us:
                self._refer(row, bool(state.referenced >> index & 1), state)

    def on_event(self, event: EventReport, moment: Moment) -> None:
        """A switch that was found or passed, and what may have cost steps."""
        if event.event in SWITCHED:
            self._on_switch(event, moment)
        elif event.event == "late":
            self._incident(LATE)
        elif event.event in ("fault", "estop"):
            self._incident(REST_FAULT)

    def on_reference(self, mask: int, positions: tuple[int, ...], t_us: int, moment: Moment) -> None:
        """A person has declared where joints stand: those of `mask`, all if it is 0, in 1/256 steps."""
        for index, row in enumerate(self._rows):
            if mask == 0 or mask >> index & 1:
                self._verify(row, VerifiedBy.REFERENCE, whole_steps(positions[index]), None, t_us, moment)

    def step(self, moment: Moment) -> None:
        """Tell and keep what is due."""
        if self._device.state is None or self._device.session.status is None:
            return
        if moment.monotonic - self._told >= self._device.resting.period(PERIOD, moment):
            self._told = moment.monotonic
            self._device.publish(STEP_LEDGER, self.message(moment), moment)
        self._keep(moment)

    def record(self) -> LedgerRecord | None:
        """What is to be kept now; None while the device is not known."""
        if self._identity is None:
            return None
        return LedgerRecord(
            device=self._device.arm.device.name,
            virtual=self._identity[0],
            config_crc32=self._identity[1],
            boot_id=self._boot,
            is_moving=self._is_moving,
            steps=tuple(row.sample.steps if row.sample is not None else 0 for row in self._rows),
            joints={row.watch.joint.name: row.evidence for row in self._rows},
        )

    def confidences(self, now: int) -> tuple[float, ...]:
        """Of every joint at `now` [ns UNIX]."""
        return tuple(confidence(row.evidence, now) if row.is_referenced else 0.0 for row in self._rows)

    def message(self, moment: Moment) -> StepLedger:
        """The ledger at this moment."""
        joints, state = self._device.joints, self._device.state
        names = tuple(joint.name for joint in joints)
        if state is None or self._device.session.is_open_loop:
            return self._unknown(names, moment)
        evidence, sure = [row.evidence for row in self._rows], self.confidences(moment.unix)
        travelled = [row.watch.travelled(row.evidence) if c > 0.0 or row.evidence.lost else math.inf
                     for row, c in zip(self._rows, sure, strict=True)]  # fmt: skip
        wide = bounds(joints, sure, travelled, LEVEL)
        lost = tuple(float(each.lost) for each in evidence)
        point = self._point.steps if self._point is not None else tuple(map(float, state.steps))
        following = [wanted - done + off for wanted, done, off in zip(point, state.steps, lost, strict=True)]
        columns = self._jacobian.columns(self._device.reporter.positions(state.steps))
        least = min(range(len(joints)), key=lambda index: sure[index])
        why = doubt(self._rows[least].watch.joint, evidence[least], self._rows[least].is_referenced, moment.unix)
        return StepLedger(
            stamp=moment.unix,
            name=names,
            commanded=point,
            executed=state.steps,
            verified=tuple(each.verified for each in evidence),
            verified_at=tuple(each.verified_at for each in evidence),
            verified_by=tuple(each.verified_by for each in evidence),
            found_off=tuple(each.found_off for each in evidence),
            turns=tuple(each.turns for each in evidence),
            load=tuple(each.load for each in evidence),
            confidence=sure,
            arm_confidence=math.prod(sure),
            doubtful=names[least],
            reason=str(why),
            lost=lost,
            bound=wide,
            tool_error=known_shift(joints, columns, following),
            tool_bound=tool_shift(joints, columns, wide),
            level=LEVEL,
            why=why,
        )

    def _unknown(self, names: tuple[str, ...], moment: Moment) -> StepLedger:
        """Of a board that does not say what it has executed: nothing is sure, at any place of the joints' ranges."""
        joints, count = self._device.joints, len(names)
        wide = bounds(joints, (0.0,) * count, (math.inf,) * count, LEVEL)
        state = self._device.state
        sent = state.steps if state is not None else (0,) * count
        columns = self._jacobian.columns(self._device.reporter.positions(sent))
        why = open_loop_reason()
        return StepLedger(
            stamp=moment.unix, name=names, commanded=tuple(map(float, sent)), confidence=(0.0,) * count,
            verified=(0,) * count, verified_at=(0,) * count, verified_by=(VerifiedBy.NOTHING,) * count,
            found_off=(0,) * count, turns=(0.0,) * count, load=(0.0,) * count, lost=(0.0,) * count,
            doubtful=names[0], reason=str(why), bound=wide, tool_bound=tool_shift(joints, columns, wide),
            open_loop=True, level=LEVEL, why=why,
        )  # fmt: skip

    def _meet(self, identity: tuple[bool, int], state: StateFrame) -> None:
        """Another device or configuration is another ledger; another boot is the same one with a doubt more."""
        if identity != self._identity:
            self._identity, self._boot = identity, state.boot_id
            self._take(self._kept, identity, state)
            self._kept = None
        elif state.boot_id != self._boot:
            self._boot = state.boot_id
            self._incident(REBOOT)
            for index, row in enumerate(self._rows):
                self._resume(row, state, index)

    def _take(self, kept: LedgerRecord | None, identity: tuple[bool, int], state: StateFrame) -> None:
        """Begin with what was kept, if it is about this device and these steps."""
        is_same = kept is not None and (kept.virtual, kept.config_crc32) == identity
        for index, row in enumerate(self._rows):
            row.evidence, row.sample, row.verified_us = Evidence(), None, 0
            known = kept.joints.get(row.watch.joint.name) if kept is not None and is_same else None
            if kept is None or known is None or len(kept.steps) != len(self._rows):
                continue
            if kept.boot_id != state.boot_id:
                known = replace(known, incidents=known.incidents + REBOOT)
            unseen = row.watch.in_time(KEEP_EVERY) if kept.is_moving else 0.0
            row.evidence = row.watch.unwatched(known, unseen + abs(state.steps[index] - kept.steps[index]))

    def _resume(self, row: JointRow, state: StateFrame, index: int) -> None:
        """The joint's steps since the last state of the boot before were seen by nobody."""
        before = row.sample.steps if row.sample is not None else state.steps[index]
        row.evidence = row.watch.unwatched(row.evidence, abs(state.steps[index] - before))
        row.sample, row.verified_us = None, 0

    def _account(self, row: JointRow, now: JointSample) -> None:
        """Turns and load since the last state; one from before the verification does not count."""
        if now.t_us < row.verified_us:
            return
        if row.sample is not None:
            row.evidence = row.watch.between(row.evidence, row.sample, now)
        row.sample = now

    def _refer(self, row: JointRow, is_referenced: bool, state: StateFrame) -> None:
        """A joint whose place the device does not know is not verified; while it homes, what was known still counts."""
        row.is_referenced = is_referenced
        if not is_referenced and state.mode != DeviceMode.HOMING:
            row.evidence = replace(row.evidence, verified_by=VerifiedBy.NOTHING)

    def _on_switch(self, event: EventReport, moment: Moment) -> None:
        """`homed`: "q1: +8 steps off", or "q1" where its place was not known. `passed`: "q1: -3 steps off"."""
        name, _, rest = event.detail.partition(":")
        found = re.search(r"[+-]?\d+", rest)
        by = VerifiedBy.HOMING if event.event == "homed" else VerifiedBy.SWITCH
        for row in self._rows:
            homing = row.watch.joint.drive.homing
            if row.watch.joint.wire_name == name.strip() and homing is not None:
                place = whole_steps(row.watch.joint.steps.to_q8(homing.position))
                self._verify(row, by, place, int(found[0]) if found is not None else None, event.t_us, moment)

    def _verify(self, row: JointRow, by: VerifiedBy, steps: int, off: int | None, t_us: int, moment: Moment) -> None:
        if by is VerifiedBy.SWITCH and not row.is_referenced:
            return
        row.evidence = after_verification(row.evidence, by, steps, off, row.watch.cycle, moment.unix)
        row.verified_us = t_us
        if by is not VerifiedBy.SWITCH:  # the count has jumped
            row.sample, row.is_referenced = None, True

    def _incident(self, doubt: float) -> None:
        for row in self._rows:
            row.evidence = replace(row.evidence, incidents=row.evidence.incidents + doubt)

    def _keep(self, moment: Moment) -> None:
        if moment.monotonic - self._written < KEEP_SOON:
            return
        record = self.record()
        if record is None or record == self._last:
            return
        last = self._last
        is_news = last is None or record.is_moving != last.is_moving or _verifications(record) != _verifications(last)
        if moment.monotonic - self._written >= (KEEP_SOON if is_news else KEEP_EVERY):
            self._written, self._last = moment.monotonic, record
            self._device.out.put(KeepLedger(record))


def _verifications(record: LedgerRecord) -> list[tuple[VerifiedBy, int]]:
    return [(each.verified_by, each.verified_at) for each in record.joints.values()]
