"""`gemelo ik` and `gemelo fk`: configurations for a tool pose, and poses of links for a configuration. Nothing
moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from schemas.planning import FkRequest, FkResponse, IkRequest, IkResponse
from schemas.topics import FK, IK
from services.cli.columns import table
from services.cli.exits import CommandError, ExitCode
from services.cli.goals import refusal_text
from services.cli.units import SHOWN

if TYPE_CHECKING:
    from services.arm.description import Arm
    from services.cli.session import Session

PATIENCE = 10.0  # [s] that the planner may search


def ik(session: Session, request: IkRequest, as_json: bool) -> ExitCode:
    """Prints the configurations, the nearest first; a refusal is raised with its reason and what would do."""
    response: IkResponse = session.node.call(IK, request, timeout=PATIENCE)
    if response.refusal is not None:
        raise CommandError(refusal_text(response.refusal, request.goal, session.arm))
    print(as_text(response) if as_json else configurations(session.arm, response))
    return ExitCode.OK


def fk(session: Session, request: FkRequest, as_json: bool) -> ExitCode:
    """Prints the poses of the links in the base frame."""
    response: FkResponse = session.node.call(FK, request, timeout=PATIENCE)
    if response.refusal is not None:
        raise CommandError(f"refused ({response.refusal.check}): {response.refusal.message}; {response.refusal.remedy}")
    print(as_text(response) if as_json else poses(response))
    return ExitCode.OK


def as_text(response: IkResponse | FkResponse) -> str:
    """The response as JSON, in SI units."""
    return msgspec.json.encode(response).decode()


def configurations(arm: Arm, response: IkResponse) -> str:
    """A row a configuration."""
    units = [SHOWN[arm.joint(name).unit] for name in response.name]
    headings = [f"{name} [{unit}]" for name, (unit, _) in zip(response.name, units, strict=True)]
    rows = [
        [*(f"{v * factor:z.4f}" for v, (_, factor) in zip(found.position, units, strict=True)), f"{found.distance:.3f}"]
        for found in response.solutions
    ]
    return table([*headings, "away [s]"], rows)


def poses(response: FkResponse) -> str:
    """A row a link: position and unit quaternion."""
    headings = ["link", "x [m]", "y [m]", "z [m]", "qx", "qy", "qz", "qw"]
    rows = [
        [link, *(f"{value:z.6f}" for value in (*pose.translation, *pose.rotation))]
        for link, pose in zip(response.links, response.poses, strict=True)
    ]
    return table(headings, rows)
