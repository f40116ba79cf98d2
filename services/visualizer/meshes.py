"""Where the mesh files of a robot lie."""

from __future__ import annotations

from pathlib import Path

from services.visualizer.model import Model


def mesh_path(folder: Path, name: str) -> Path:
    """The file that a URDF's `filename` means: relative to the robot's folder, `package://<name>/` stripped."""
    if name.startswith("package://"):
        name = name.removeprefix("package://").partition("/")[2]
    return folder / name.removeprefix("file://")


def missing_meshes(model: Model, folder: Path) -> list[str]:
    """The mesh files that the model names and that are not there."""
    names = {visual.shape.file for visuals in model.visuals.values() for visual in visuals if visual.shape.file}
    return sorted(name for name in names if not mesh_path(folder, name).is_file())
