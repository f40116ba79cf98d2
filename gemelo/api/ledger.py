"""The step ledger as a script reads it, and the confidence that a script may require before anything moves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from gemelo.api.errors import BadArgument, Refused, why_of
from gemelo.api.session import Session
from gemelo.schemas.ledger import StepLedger, VerifiedBy
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import STEP_LEDGER


@dataclass(frozen=True)
class JointLedger:
    """One joint's page of the ledger.

    >>> page = arm.ledger.joints["brazo_joint"]
    >>> abs(page.commanded - page.executed) <= 0.51, 0.0 <= page.confidence <= 1.0
    (True, True)
    """

    commanded: float  # [steps] what the path asks for
    executed: int | None  # [steps] emitted; None where the board does not say
    verified: int  # [steps] the true count at the last verification
    verified_at: int  # [ns] UNIX time of it; 0: never
    verified_by: VerifiedBy  # NOTHING, HOMING, SWITCH or REFERENCE
    found_off: int  # [steps] by which the counter was then beside it
    turns: float  # [rev] of the motor shaft since then
    load: float  # largest share of the pull-out torque since then
    confidence: float  # 0 to 1: that no step has been lost since
    bound: float  # [steps] that it may be off, at the ledger's level


@dataclass(frozen=True)
class Ledger:
    """How sure it is that no step is lost; the model is docs/ledger.md's.

    >>> ledger = arm.ledger
    >>> ledger.confidence <= min(page.confidence for page in ledger.joints.values())
    True
    >>> ledger.tool_error < 0.005, ledger.level
    (True, 0.95)
    """

    joints: dict[str, JointLedger]
    confidence: float  # 0 to 1: no joint has lost a step
    doubtful: str  # the joint with the least confidence
    reason: str  # why that is what it is, with the remedy
    tool_error: float  # [m] that the tool is known to be off
    tool_bound: float  # [m] that it is off at most, with the probability `level`
    level: float  # 0 to 1
    open_loop: bool  # the board does not say what it has executed: nothing here is measured


def read_ledger(message: StepLedger) -> Ledger:
    """The message by joints."""
    executed = message.executed or (None,) * len(message.name)
    rows = zip(
        message.name, message.commanded, executed, message.verified, message.verified_at, message.verified_by,
        message.found_off, message.turns, message.load, message.confidence, message.bound, strict=True,
    )  # fmt: skip
    return Ledger(
        joints={name: JointLedger(*values) for name, *values in rows},
        confidence=message.arm_confidence,
        doubtful=message.doubtful,
        reason=message.reason,
        tool_error=message.tool_error,
        tool_bound=message.tool_bound,
        level=message.level,
        open_loop=message.open_loop,
    )


class Requirement:
    """The least confidence at which this connection moves the arm; 0 until a script requires one."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.level = 0.0

    def require(self, level: float) -> None:
        """Refuses at once, and from now on before every motion, below `level`, a share; 0 requires nothing any more."""
        if not 0.0 <= level <= 1.0:
            raise BadArgument(because("argument.confidence", value=level))
        self.level = level
        self.check()

    def check(self) -> None:
        """Raises `Refused` where the arm is less sure than required."""
        if not self.level:
            return
        ledger = self._session.newest(STEP_LEDGER)
        if ledger.arm_confidence < self.level:
            why, sure = why_of(ledger), ledger.arm_confidence
            raise Refused(
                because("client.confidence", why, value=_rounded_down(sure), limit=self.level),
                check="confidence",
                subject=ledger.doubtful,
                value=ledger.arm_confidence,
                limit=self.level,
                remedy="arm.verify()" if not ledger.open_loop else "",
                reason=why,
            )

    @contextmanager
    def suspended(self) -> Iterator[None]:
        """For the motions that raise the confidence."""
        level, self.level = self.level, 0.0
        try:
            yield
        finally:
            self.level = level


def _rounded_down(share: float) -> float:
    """To a tenth of a per cent: what is not reached must not read as if it were."""
    return int(share * 1000.0) / 1000.0
