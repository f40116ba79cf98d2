"""The planning scene on the disk: as JSON, written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from schemas.scene import PlanningScene

FILE = "scene.json"


class DamagedScene(ValueError):
    """A file that holds no scene; the text says why, and where it lies now."""


def save_scene(path: Path, scene: PlanningScene) -> None:
    """Replaces the file at once; raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.new")
    with beside.open("wb") as file:
        file.write(msgspec.json.format(msgspec.json.encode(scene)))
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, path)


def load_scene(path: Path) -> PlanningScene | None:
    """The scene of the file, None where there is none; raises `DamagedScene`."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=PlanningScene)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise DamagedScene(f"{path} holds no scene: {error}") from None


def put_aside(path: Path) -> Path:
    """Renames the file, so that nothing overwrites it; returns where it lies now: where it did if the disk refuses."""
    aside = path.with_name(f"{path.name}.damaged")
    try:
        os.replace(path, aside)
    except OSError:
        return path
    return aside
