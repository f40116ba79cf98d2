"""The reason for a joint's confidence, as a sentence with the remedy."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.ledger import VerifiedBy
from gemelo.services.stepper_gateway.ledger.confidence import AGE, TURNS, Evidence, strong_enough


def open_loop_reason() -> str:
    """Of a board with another dialect."""
    return (
        "this board does not say what it has executed: no joint can be verified over its wire, and a message that it "
        "has lost without falling silent is not noticed"
    )


def remedy(joint: Joint) -> str:
    """How the joint can be verified."""
    if joint.drive.homing is not None:
        return "`gemelo verify`"
    return f"it has no switch: `gemelo reference --joints {joint.name}=...`"


def doubt(joint: Joint, evidence: Evidence, is_referenced: bool, now: int) -> str:
    """What lowers the joint's confidence most, at `now` [ns UNIX]."""
    name = f'joint "{joint.name}"'
    if not is_referenced or evidence.verified_by is VerifiedBy.NOTHING:
        return f"{name}: its place was not verified: {remedy(joint)}"
    if evidence.lost:
        return f"{name} was {evidence.lost:+d} steps off when it passed its switch: `gemelo home {joint.name}`"
    age = max(0, now - evidence.verified_at) * 1e-9
    parts = {
        f"it was asked for {evidence.load:.0%} of its pull-out torque": 1.0 - strong_enough(evidence),
        f"its motor has made {evidence.turns:.0f} turns": evidence.turns / TURNS,
        f"that was {age / 3600.0:.1f} hours ago": age / AGE,
        "since then the device had faults or restarts": evidence.incidents,
    }
    what = max(parts, key=lambda part: parts[part])
    return f"{name}, verified by {evidence.verified_by.value}: {what}: {remedy(joint)}"
