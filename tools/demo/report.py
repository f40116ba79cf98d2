"""The figures of a demonstration as `out/demo.json` and as tables, and the bounds that they must keep."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.demo.ledger import StepTotals

# Half a step is what rounding to whole steps alone makes; the path itself is known to 1/256 step.
FOLLOWING_LIMIT = 0.5 + 1.0 / 256.0  # [steps]
FINAL_LIMIT = 0.5 + 1.0 / 256.0  # [steps]


class Move(msgspec.Struct, frozen=True, kw_only=True):
    """One motion of the demonstration."""

    name: Reason
    succeeded: bool
    why: Reason | None = None  # of one that failed
    plan_ms: float | None = None  # None for the streamed sine
    took_s: float = 0.0
    final_error_steps: float = 0.0  # largest of all joints


class JointTotals(msgspec.Struct, frozen=True):
    """One joint after the last move."""

    commanded_steps: int  # absolute, where the last stream was to end
    executed_steps: int  # absolute, the device's own count
    max_following_error_steps: float


class PlanTimes(msgspec.Struct, frozen=True):
    """Quantiles of the planning times [ms]."""

    p50: float
    p99: float


class DemoReport(msgspec.Struct, frozen=True):
    """The content of `out/demo.json`."""

    robot: str
    moves: int
    succeeded: int
    max_following_error_steps: float
    max_final_error_steps: float
    lost_steps: int
    chunks_sent: int
    chunks_lost: int
    plan_ms: PlanTimes
    joints: dict[str, JointTotals]


def report_of(robot: str, moves: Sequence[Move], ledger: StepTotals) -> DemoReport:
    """The figures of a whole demonstration."""
    plans = [move.plan_ms for move in moves if move.plan_ms is not None]
    joints = {
        name: JointTotals(ledger.commanded.get(name, steps), steps, ledger.following.get(name, 0.0))
        for name, steps in ledger.executed.items()
    }
    return DemoReport(
        robot=robot,
        moves=len(moves),
        succeeded=sum(move.succeeded for move in moves),
        max_following_error_steps=max(ledger.following.values(), default=0.0),
        max_final_error_steps=max((move.final_error_steps for move in moves), default=0.0),
        lost_steps=ledger.lost_steps,
        chunks_sent=ledger.chunks_sent,
        chunks_lost=ledger.chunks_lost,
        plan_ms=PlanTimes(quantile(plans, 0.5), quantile(plans, 0.99)),
        joints=joints,
    )


def quantile(values: Sequence[float], share: float) -> float:
    """The smallest value that at least `share` (0 to 1) of all values do not exceed; 0 without values."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)] if ordered else 0.0


def complaints(report: DemoReport, ledger: StepTotals) -> list[Reason]:
    """Every bound that is not kept; empty if the demonstration succeeded."""
    found: list[Reason] = []
    if report.succeeded < report.moves or report.moves == 0:
        found.append(because("demo.moves", failed=report.moves - report.succeeded, count=report.moves))
    if report.max_following_error_steps > FOLLOWING_LIMIT:
        found.append(because("demo.following", error=report.max_following_error_steps, limit=FOLLOWING_LIMIT))
    if report.max_final_error_steps > FINAL_LIMIT:
        found.append(because("demo.final", error=report.max_final_error_steps, limit=FINAL_LIMIT))
    if report.lost_steps:
        found.append(because("demo.lost", steps=report.lost_steps))
    if not ledger.is_settled:
        found.append(because("demo.not_settled"))
    if report.chunks_lost:
        found.append(because("demo.chunks", lost=report.chunks_lost, sent=report.chunks_sent))
    if not report.chunks_sent or not report.joints:
        found.append(because("demo.no_device"))
    return found


def text_of(report: DemoReport, moves: Sequence[Move]) -> str:
    """Tables of moves and joints, and a closing line."""
    rows = [
        (
            sentence(move.name),
            _result(move),
            "-" if move.plan_ms is None else f"{move.plan_ms:.2f}",
            f"{move.took_s:.2f}",
            f"{move.final_error_steps:.3f}",
        )
        for move in moves
    ]
    totals = [
        (name, str(joint.commanded_steps), str(joint.executed_steps), f"{joint.max_following_error_steps:.3f}")
        for name, joint in report.joints.items()
    ]
    closing = because(
        "demo.closing",
        succeeded=report.succeeded, moves=report.moves, steps=report.lost_steps,
        lost=report.chunks_lost, sent=report.chunks_sent, p50=report.plan_ms.p50, p99=report.plan_ms.p99,
    )  # fmt: skip
    return "\n".join(
        (
            table(columns("move", "result", "planned in [ms]", "took [s]", "final error [steps]"), rows),
            "",
            table(columns("joint", "commanded [steps]", "executed [steps]", "largest following error [steps]"), totals),
            "",
            sentence(closing),
        )
    )


def _result(move: Move) -> str:
    if move.why is None:
        return word("result", "ok")
    return sentence(because("demo.move.failed", move.why))
