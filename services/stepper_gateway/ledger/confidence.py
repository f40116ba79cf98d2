"""The probability that a joint has lost no step since its place was verified. The model, its constants, its reasons.

    c = base * P(strong enough) * exp(-(turns / TURNS + age / AGE + incidents))

P(strong enough): a motor gives a share w of the torque that robot.toml states, and nobody knows w. It loses steps once
a motion asks for more: a load (share of the stated pull-out torque) above w. Before anything is known
S(x) = P(w > x) = 1 / (1 + (x / HALF)^STEEPNESS), the log-logistic law of survival analysis (Bennett 1983). What
verifications have shown narrows it: after one without loss w > proven, after one with a loss w < refuted, so with the
highest load since

    P = (S(load) - S(refuted)) / (S(p) - S(refuted)) with p = PROOF * proven, 1 up to p and 0 from `refuted` on.

exp(...): what the torque does not explain, at a constant rate: a hand on the arm, a cable, a loose coupling.

Confidence of the arm: the product over its joints, as their motors are independent. docs/ledger.md has the calibration.
"""

from __future__ import annotations

import math

from msgspec import Struct

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.ledger import VerifiedBy
from gemelo.schemas.reasons import Reason, Remedy, because, remedy

HALF = 0.35  # load at which half of all motors would lose steps; chosen: below the stated torque, as rotors swing
STEEPNESS = 3.0  # chosen: one motor in 6 fails at 0.2 of its stated torque, one in 44 at 0.1
PROOF = 0.9  # of a load that a verification has proven; chosen: near pull-out steps are lost in one motion, not in all
CLEAN = 3  # verifications without a loss, after one with a loss, until that is forgotten; chosen: losses can cancel out
TURNS = 100_000.0  # [rev] of the motor shaft after which 1/e is left; chosen: a day of steady work at a turn a second
AGE = 30.0 * 86_400.0  # [s] after which 1/e is left; chosen: a month, in which people bump into an arm
BASE = {  # confidence at the moment of the verification
    VerifiedBy.NOTHING: 0.0,
    VerifiedBy.HOMING: 1.0,
    VerifiedBy.SWITCH: 1.0,
    VerifiedBy.REFERENCE: 0.995,  # chosen: a person's eye
}
MEASURED = (VerifiedBy.HOMING, VerifiedBy.SWITCH)
REST_FAULT = 0.02  # incident: a fault while the arm stood; chosen: it may have been hit
REBOOT = 0.05  # incident: a restart at rest; chosen: the motors had no current
LATE = 0.5  # incident: pulses that stopped without a ramp; chosen: at speed a rotor mostly slips then


class Evidence(Struct, frozen=True, kw_only=True):
    """What is known of one joint since its last verification, and of its motor from those before."""

    verified_by: VerifiedBy = VerifiedBy.NOTHING
    verified_at: int = 0  # [ns] UNIX
    verified: int = 0  # [steps]
    found_off: int = 0  # [steps]
    turns: float = 0.0  # [rev] of the motor shaft
    load: float = 0.0  # largest share of the stated pull-out torque
    incidents: float = 0.0  # their sum
    proven: float = 0.0  # the largest load after which a verification has found no step lost
    refuted: float = 0.0  # the smallest load after which one has found steps lost; 0: none
    suspicion: int = 0  # verifications without a loss that are still to come until `refuted` is forgotten
    lost: int = 0  # [steps] found by a switch that was passed, and not corrected


class LedgerRecord(Struct, frozen=True, kw_only=True):
    """The ledger as it is kept over restarts (`ledger_file.py`): one arm on one device. Where the device or its
    configuration is another, none of it counts."""

    device: str = ""
    virtual: bool = False
    config_crc32: int = 0  # steps of another configuration mean other places
    boot_id: int = 0
    is_moving: bool = False  # what came after this was written, nobody knows
    steps: tuple[int, ...] = ()  # executed
    joints: dict[str, Evidence] = {}  # by name


def survival(load: float) -> float:
    """P(w > load): the share of motors that follow at `load`, before anything is known of them."""
    return 1.0 / (1.0 + (load / HALF) ** STEEPNESS) if load > 0.0 else 1.0


def strong_enough(evidence: Evidence) -> float:
    """The probability (a share, 0 to 1) that no step was lost for want of torque, by the load since the verification
    and what is proven and refuted."""
    load, proven = evidence.load, PROOF * evidence.proven
    if load <= proven:
        return 1.0
    if evidence.refuted and load >= evidence.refuted:
        return 0.0
    floor = survival(evidence.refuted) if evidence.refuted else 0.0
    return (survival(load) - floor) / (survival(proven) - floor)


def confidence(evidence: Evidence, now: int) -> float:
    """0 to 1 at `now` [ns UNIX]; a clock that was set back adds nothing."""
    if evidence.lost:
        return 0.0
    age = max(0, now - evidence.verified_at) * 1e-9
    expected = evidence.turns / TURNS + age / AGE + evidence.incidents  # losses that the torque does not explain
    return BASE[evidence.verified_by] * strong_enough(evidence) * math.exp(-expected)


def after_verification(
    evidence: Evidence, by: VerifiedBy, steps: int, off: int | None, cycle: float, now: int
) -> Evidence:
    """The evidence from a verification on, at `now` [ns UNIX], which found the true count `steps`.

    `off` [steps]: what the counter lacks; None where it had meant nothing. A motor loses whole cycles of its field, of
    `cycle` [steps] each: less than half a one is the switch's own spread. A homing corrects the counter, a switch that
    is passed does not. A loss revokes what was proven before: the motor or its load has changed.
    """
    is_off = off is not None and abs(off) >= 0.5 * cycle
    proven, refuted, suspicion = evidence.proven, evidence.refuted, evidence.suspicion
    if off is not None and evidence.verified_by in MEASURED:
        proven, refuted, suspicion = _learned(evidence, is_off)
    return Evidence(
        verified_by=by,
        verified_at=now,
        verified=steps,
        found_off=off or 0,
        proven=proven,
        refuted=refuted,
        suspicion=suspicion,
        lost=off or 0 if is_off and by is VerifiedBy.SWITCH else 0,
    )


def _learned(evidence: Evidence, is_off: bool) -> tuple[float, float, int]:
    """`proven`, `refuted` and `suspicion` after a verification that found steps lost, or none."""
    load = evidence.load
    if is_off:
        return 0.0, min(evidence.refuted or load, load), CLEAN
    if evidence.suspicion > 1:
        return 0.0, evidence.refuted, evidence.suspicion - 1
    return max(evidence.proven, load), 0.0 if evidence.suspicion else evidence.refuted, 0


def open_loop_reason() -> Reason:
    """Of a board with another dialect."""
    return because("ledger.open_loop")


def verifying(joint: Joint) -> Remedy:
    """How the joint can be verified."""
    return remedy("verify") if joint.drive.homing is not None else remedy("reference_joint", joint=joint.name)


def doubt(joint: Joint, evidence: Evidence, is_referenced: bool, now: int) -> Reason:
    """What lowers the joint's confidence most, at `now` [ns UNIX]."""
    if not is_referenced or evidence.verified_by is VerifiedBy.NOTHING:
        return because("ledger.unverified", verifying(joint), joint=joint.name)
    if evidence.lost:
        home = remedy("home_joint", joint=joint.name)
        return because("ledger.steps_lost", home, joint=joint.name, lost=evidence.lost)
    age = max(0, now - evidence.verified_at) * 1e-9
    by = {"joint": joint.name, "by": evidence.verified_by.value}
    parts = {
        "ledger.doubt.load": (1.0 - strong_enough(evidence), {"load": evidence.load}),
        "ledger.doubt.turns": (evidence.turns / TURNS, {"turns": evidence.turns}),
        "ledger.doubt.age": (age / AGE, {"hours": age / 3600.0}),
        "ledger.doubt.incidents": (evidence.incidents, {}),
    }
    code = max(parts, key=lambda part: parts[part][0])
    return because(code, verifying(joint), **by, **parts[code][1])
