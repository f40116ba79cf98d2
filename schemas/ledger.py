"""The step ledger: how sure it is that no joint has lost a step; and how far the arm goes if all is lost now."""

from __future__ import annotations

from enum import StrEnum

from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason


class VerifiedBy(StrEnum):
    """What a joint's place was taken from."""

    NOTHING = "nothing"
    HOMING = "homing"
    SWITCH = "switch"  # its home switch, passed while it moved, whose closing the device has latched
    REFERENCE = "reference"  # a person has declared it


class StepLedger(Message, frozen=True, kw_only=True):
    """Commanded, executed and verified steps of every joint, and what follows for the tool.

    A confidence is the probability that no step has been lost, by the model of docs/ledger.md.
    """

    stamp: int = 0  # [ns] UNIX time
    name: tuple[str, ...] = ()
    commanded: Vector = ()  # [steps] what the path asks for
    executed: tuple[int, ...] = ()  # [steps] emitted; empty where the device does not say
    verified: tuple[int, ...] = ()  # [steps] the true count at the last verification
    verified_at: tuple[int, ...] = ()  # [ns] UNIX time of it; 0: never
    verified_by: tuple[VerifiedBy, ...] = ()
    found_off: tuple[int, ...] = ()  # [steps] by which the counter was then beside it
    turns: Vector = ()  # [rev] of the motor shaft since then
    load: Vector = ()  # largest share of the pull-out torque since then
    confidence: Vector = ()  # 0 to 1
    arm_confidence: float = 0.0  # 0 to 1: no joint has lost a step
    doubtful: str = ""  # the joint with the least confidence
    reason: str = ""  # why that is what it is, with the remedy
    lost: Vector = ()  # [steps] known to be lost and not corrected yet
    bound: Vector = ()  # [steps] by which a joint may be off, at `level`
    tool_error: float = 0.0  # [m] that the tool is known to be off
    tool_bound: float = 0.0  # [m] that it is off at most, at `level`
    level: float = 0.95  # the confidence of both bounds
    open_loop: bool = False  # the device does not say what it has executed: nothing here is measured
    why: Reason | None = None  # `reason` as data


class StoppingDistance(Message, frozen=True, kw_only=True):
    """How far the tool goes from `stamp` on if gateway, network or broker were lost at that moment."""

    stamp: int = 0  # [ns] UNIX time
    is_known: bool = False
    reason: str = ""  # why it is not
    distance: float = 0.0  # [m] along the tool's path, at most
    duration: float = 0.0  # [s] until it rests, at most
    reaction: float = 0.0  # [s] of that until the device notices
    round_trip: float = 0.0  # [s] the longest of late, which the device's last heartbeat may have taken
    why: Reason | None = None  # `reason` as data
