"""The cell of the robot that a command is for: from its file, else over the bus."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.libraries.arm.cell.cell_file import Cell, deployed_cell
from gemelo.libraries.arm.cell.cell_file import cell_of as cell_in
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.session import connect

if TYPE_CHECKING:
    from gemelo import Robot

PATIENCE = 1.0  # [s] for the cell to come over the bus


def cell_of(robot: Robot) -> Cell:
    """The cell of the robot's twin, an empty one where it has none; raises `CommandError` where its files are wrong."""
    try:
        return deployed_cell(robot.deployment) if robot.deployment.cell else _published(robot)
    except DescriptionError as error:
        raise usage(error) from error


def _published(robot: Robot) -> Cell:
    from gemelo.schemas.topics import CELL  # slow to load: the table

    try:
        with connect(robot) as session:
            latest, end = session.node.latest(CELL), session.node.monotonic() + PATIENCE
            while latest.message is None and session.node.monotonic() < end:
                session.node.wait(0.02)
    except CommandError as error:
        if error.code is not ExitCode.NO_STACK:
            raise
        return Cell(Path())
    texts = latest.message
    return cell_in(texts, robot.description, is_here=False) if texts is not None and texts.path else Cell(Path())
