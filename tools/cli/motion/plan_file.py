"""A plan as a file: written by `gemelo move ... --plan-only --json`, executed by `gemelo move --execute`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.planning import PlanResponse
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.text_file import decode_text
from gemelo.tools.cli.common.errors import CommandError, usage
from gemelo.tools.cli.common.language import word

if TYPE_CHECKING:
    from gemelo import Plan
    from gemelo.libraries.arm.model.description import ArmDescription

STANDARD_INPUT = "-"
LARGEST_FILE = 100_000_000  # [bytes] a trajectory of an hour has a tenth of it


class PlanFile(msgspec.Struct, frozen=True, kw_only=True):
    """The fields of the file that count here; --plan-only --json writes others beside them."""

    robot: str
    response: PlanResponse


def read_plan(source: str, arm: ArmDescription) -> Plan:
    """The plan in a file, or on standard input for `-`.

    Raises `CommandError` naming the file if it holds no plan, or one that `arm` cannot follow. Whether the arm stands
    where the plan begins, and whether the scene is still the one that it was made in, is the gateway's to judge.
    """
    name = word("file", "standard input") if source == STANDARD_INPUT else source
    try:
        saved = msgspec.json.decode(decode_text(_read(source, name)), type=PlanFile)
    except (msgspec.MsgspecError, ValueError) as error:
        raise usage(because("cli.plan.not_one", name=name, error=str(error))) from error
    if saved.robot != arm.name:
        raise usage(because("cli.plan.other_robot", name=name, planned=saved.robot, robot=arm.name))
    _require_trajectory(saved.response, name, arm)
    return gemelo.Plan(saved.robot, {}, saved.response)


def _read(source: str, name: str) -> bytes:
    try:
        if source == STANDARD_INPUT:
            return sys.stdin.buffer.read(LARGEST_FILE)
        path = Path(source)
        if path.is_file() and path.stat().st_size > LARGEST_FILE:
            raise usage(because("cli.plan.large", name=name, size=path.stat().st_size, limit=LARGEST_FILE))
        return path.read_bytes()
    except OSError as error:
        raise usage(because("cli.plan.unreadable", name=name, error=str(error.strerror))) from error


def _require_trajectory(plan: PlanResponse, name: str, arm: ArmDescription) -> None:
    """Raises `CommandError` for a refused plan, an empty one, and one whose points are not of `arm`'s joints."""
    if plan.refusal is not None:
        raise CommandError(because("cli.plan.refusal", plan.refusal.why or plain(plan.refusal.message), name=name))
    joints = plan.trajectory.joint_names
    if not plan.trajectory.points:
        raise usage(because("cli.plan.empty", name=name))
    if sorted(joints) != sorted(arm.joint_names):
        planned, own = ", ".join(joints) or "-", ", ".join(arm.joint_names)
        raise usage(because("cli.plan.joints", name=name, planned=planned, robot=arm.name, joints=own))
    for index, point in enumerate(plan.trajectory.points):
        if len(point.positions) != len(joints):
            size = len(point.positions)
            raise usage(because("cli.plan.point", name=name, point=index, count=size, joints=len(joints)))
