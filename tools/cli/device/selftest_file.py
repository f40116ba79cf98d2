"""Writing into robot.toml what a self-test has found: a motor that turns the other way, the current of its driver."""

from __future__ import annotations

import os
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import tomlkit

from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError


def write_findings(path: Path, turned: tuple[str, ...], currents: Mapping[str, float], today: date) -> None:
    """Turns `inverted` of the joints `turned`, and notes each driver's current [A] beside its `driver`.

    Everything else of the file stays as it is, comments too; the file is replaced at once. Raises `CommandError`.
    """
    try:
        text = path.read_text(encoding="utf-8")
        beside = path.with_name(f".{path.name}.new")
        beside.write_text(with_findings(text, turned, currents, today), encoding="utf-8")
        os.replace(beside, path)
    except OSError as error:
        raise CommandError(
            because("selftest.file.unwritten", file=str(path), error=str(error.strerror or error))
        ) from error


def with_findings(text: str, turned: tuple[str, ...], currents: Mapping[str, float], today: date) -> str:
    """The text of robot.toml with them; `currents` are [A] by joint."""
    document = tomlkit.parse(text)
    joints: Any = document["joint"]
    for joint in joints:
        motor = joint["motor"]
        if joint["name"] in turned:
            motor["inverted"] = not motor.get("inverted", False)
        if (current := currents.get(joint["name"])) is not None:
            motor.item("driver").comment(f"set to {current:g} A, {today.isoformat()}")
    return tomlkit.dumps(document)
