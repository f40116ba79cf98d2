"""Intake of `ra/juntas` for an arm of ours: relative degrees in, absolute positions within the limits out. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription, Joint

OUTPUT = "avanzar"
LARGEST = 256  # [bytes] of a message
FARTHEST = 1.0e6  # [deg] of one message


class RefusedMessage(ReasonedError, ValueError):
    """A message that is not followed; the reason says why."""


class RequestedMotion(NamedTuple):
    """What one message asks for; None where it says nothing of it."""

    moves: tuple[Fraction, ...] | None  # [steps] by joint, relative
    output: bool | None
    objection: Reason | None = None  # why the joints that it names do not move, though its output is switched


class RaIntake:
    """Where the arm is to be, in exact fractions of a step: no remainder of any message is lost."""

    def __init__(self, arm: ArmDescription) -> None:
        self._joints = arm.joints
        self._names = tuple(joint.wire_name for joint in arm.joints)
        self.target_steps: tuple[Fraction, ...] | None = None  # [steps] of each joint; None if nothing is asked for

    @property
    def target(self) -> tuple[float, ...] | None:
        """[rad] or [m] by joint; None if nothing is asked for."""
        if self.target_steps is None:
            return None
        return tuple(_position(joint, steps) for joint, steps in zip(self._joints, self.target_steps, strict=True))

    def take(self, payload: bytes, stands: Sequence[int]) -> RequestedMotion:
        """A message, while the arm stands at `stands` [steps]; raises `RefusedMessage`, and the target before stays."""
        wanted = self._read(payload)
        if wanted.moves is None:
            return wanted
        base = self.target_steps if self.target_steps is not None else tuple(map(Fraction, stands))
        target = tuple(at + move for at, move in zip(base, wanted.moves, strict=True))
        for joint, steps in zip(self._joints, target, strict=True):
            _require_within(joint, steps)
        self.target_steps = target
        return wanted

    def forget(self) -> None:
        """Somebody has stopped the arm: nothing of what was asked is continued."""
        self.target_steps = None

    def is_reached(self, stands: Sequence[int]) -> bool:
        """True if the arm stands on the nearest steps; the fractions are kept for the next message."""
        return self.target_steps is None or all(
            abs(steps - count) <= Fraction(1, 2) + Fraction(1, 128)
            for steps, count in zip(self.target_steps, stands, strict=True)
        )

    def forget_if_elsewhere(self, stands: Sequence[int]) -> None:
        """The arm at rest was moved by somebody else meanwhile: the next message counts from there."""
        if not self.is_reached(stands):
            self.forget()

    def _read(self, payload: bytes) -> RequestedMotion:
        found = _object(payload)
        output = found.get(OUTPUT)
        if output is not None and (isinstance(output, str) or output not in (0, 1)):
            raise RefusedMessage(because("ra.output", output=OUTPUT, value=repr(output)))
        missing = [name for name in self._names if name not in found]
        if len(missing) == len(self._names) and output is not None:
            return RequestedMotion(None, bool(output))
        if missing:
            objection = because("ra.missing", missing=", ".join(missing), names=", ".join(self._names))
            if output is None:
                raise RefusedMessage(objection)
            return RequestedMotion(None, bool(output), objection)
        moves = zip(self._joints, self._names, strict=True)
        steps = tuple(_degrees(found[name], name) * joint.steps.steps_per_turn / 360 for joint, name in moves)
        return RequestedMotion(steps, None if output is None else bool(output))


def _object(payload: bytes) -> dict[str, object]:
    if len(payload) > LARGEST:
        raise RefusedMessage(because("ra.long", size=len(payload), most=LARGEST))
    try:
        found = json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise RefusedMessage(because("ra.no_json", text=repr(payload[:40]), error=str(error))) from error
    if not isinstance(found, dict):
        raise RefusedMessage(because("ra.no_object", text=repr(payload[:40])))
    return found


def _degrees(value: object, name: str) -> Fraction:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RefusedMessage(because("ra.not_degrees", name=name, value=repr(value)))
    if not (math.isfinite(value) and abs(value) <= FARTHEST) if isinstance(value, float) else abs(value) > FARTHEST:
        raise RefusedMessage(because("ra.far", name=name, value=f"{value!s:.20}"))
    return Fraction(value)


def _position(joint: Joint, steps: Fraction) -> float:
    return joint.clamp(joint.steps.to_position(float(steps)))


def _require_within(joint: Joint, steps: Fraction) -> None:
    position, half = joint.steps.to_position(float(steps)), 0.5 / joint.steps.per_unit
    if joint.lower - half <= position <= joint.upper + half:
        return
    limit = joint.lower if position < joint.lower else joint.upper
    too_far = abs(position - limit) / joint.steps.travel_per_turn * 360.0
    why = because(
        "ra.limit",
        joint=joint.name, wire_name=joint.wire_name, position=position, limit=limit, unit=joint.unit, degrees=too_far,
    )  # fmt: skip
    raise RefusedMessage(why)
