"""The planning scene on the disk: as JSON beside the files of its meshes, each written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.scene_meshes import by_digest, digests_in, mesh_digest, meshes_in, with_meshes

FILE = "scene.json"
MESHES, STL = "scene_meshes", ".stl"  # the folder beside it, and its files, by their digests


class DamagedScene(ReasonedError, ValueError):
    """A file that holds no scene; the reason says why."""


def save_scene(path: Path, scene: PlanningScene) -> None:
    """Replaces the file at once, and puts the files of its meshes beside it, each once; raises OSError."""
    folder, meshes = path.parent / MESHES, meshes_in(scene)
    for digest, content in meshes.items():
        if not _mesh_file(folder, digest).is_file():
            folder.mkdir(parents=True, exist_ok=True)
            _write(_mesh_file(folder, digest), content)
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(path, msgspec.json.format(msgspec.json.encode(by_digest(scene))))
    for old in folder.glob(f"*{STL}"):
        if old.stem not in meshes:
            old.unlink(missing_ok=True)


def load_scene(path: Path) -> PlanningScene | None:
    """The scene of the file with the files of its meshes, None where there is none; raises `DamagedScene`.

    A mesh whose file is missing or another one keeps its digest alone.
    """
    try:
        scene = msgspec.json.decode(path.read_bytes(), type=PlanningScene)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise DamagedScene(because("scene.file.damaged", file=str(path), detail=str(error))) from None
    contents = ((digest, _read(_mesh_file(path.parent / MESHES, digest))) for digest in digests_in(scene))
    return with_meshes(scene, {digest: content for digest, content in contents if mesh_digest(content) == digest})


def _mesh_file(folder: Path, digest: str) -> Path:
    return folder / f"{digest if digest.isalnum() else 'none'}{STL}"


def _read(path: Path) -> bytes:
    """Empty where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _write(path: Path, content: bytes) -> None:
    beside = path.with_name(f"{path.name}.new")
    with beside.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, path)


def put_aside(path: Path) -> Path:
    """Renames the file, so that nothing overwrites it; returns where it lies now: where it did if the disk refuses."""
    aside = path.with_name(f"{path.name}.damaged")
    try:
        os.replace(path, aside)
    except OSError:
        return path
    return aside
