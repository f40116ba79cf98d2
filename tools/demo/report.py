"""The figures of a demonstration as `out/demo.json` and as tables, and the bounds that they must keep."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from gemelo.tools.cli.common.text_table import table
from gemelo.tools.demo.ledger import StepTotals

# Half a step is what rounding to whole steps alone makes; the path itself is known to 1/256 step.
FOLLOWING_LIMIT = 0.5 + 1.0 / 256.0  # [steps]
FINAL_LIMIT = 0.5 + 1.0 / 256.0  # [steps]


class Move(msgspec.Struct, frozen=True, kw_only=True):
    """One motion of the demonstration."""

    name: str
    succeeded: bool
    reason: str = ""
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


def complaints(report: DemoReport, ledger: StepTotals) -> list[str]:
    """Every bound that is not kept, one sentence each; empty if the demonstration succeeded."""
    found = []
    if report.succeeded < report.moves or report.moves == 0:
        found.append(f"{report.moves - report.succeeded} of {report.moves} moves failed")
    if report.max_following_error_steps > FOLLOWING_LIMIT:
        found.append(f"following error {report.max_following_error_steps:.3f} steps, limit {FOLLOWING_LIMIT:.3f}")
    if report.max_final_error_steps > FINAL_LIMIT:
        found.append(f"final error {report.max_final_error_steps:.3f} steps, limit {FINAL_LIMIT:.3f}")
    if report.lost_steps:
        found.append(f"{report.lost_steps} steps lost")
    if not ledger.is_settled:
        found.append("the device was not seen at rest after the last stream, so its steps are not accounted for")
    if report.chunks_lost:
        found.append(f"{report.chunks_lost} of {report.chunks_sent} chunks were never acknowledged")
    if not report.chunks_sent or not report.joints:
        found.append("nothing was heard of the device")
    return found


def text_of(report: DemoReport, moves: Sequence[Move]) -> str:
    """Tables of moves and joints, and a closing line."""
    rows = [
        (
            move.name,
            "ok" if move.succeeded else f"failed: {move.reason}",
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
    return "\n".join(
        (
            table(("move", "result", "planned in [ms]", "took [s]", "final error [steps]"), rows),
            "",
            table(("joint", "commanded [steps]", "executed [steps]", "largest following error [steps]"), totals),
            "",
            f"{report.succeeded} of {report.moves} moves succeeded; {report.lost_steps} steps lost; "
            f"{report.chunks_lost} of {report.chunks_sent} chunks lost; "
            f"planned in {report.plan_ms.p50:.2f} ms (p50), {report.plan_ms.p99:.2f} ms (p99)",
        )
    )
