"""Mesh files of the robot and of the scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from gemelo.libraries.arm.stl import BadStl, read_stl
from gemelo.schemas.scene import MeshShape
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh
from gemelo.services.visualizer.model.visual_model import VisualModel


def mesh_path(folder: Path, name: str) -> Path:
    """The file that a URDF's `filename` means: relative to the robot's folder, `package://<name>/` stripped."""
    if name.startswith("package://"):
        name = name.removeprefix("package://").partition("/")[2]
    return folder / name.removeprefix("file://")


def missing_meshes(model: VisualModel, folder: Path) -> list[str]:
    """The mesh files that the model names and that are not there."""
    names = {visual.shape.file for visuals in model.visuals.values() for visual in visuals if visual.shape.file}
    return sorted(name for name in names if not mesh_path(folder, name).is_file())


def scene_mesh(shape: MeshShape, folders: Sequence[Path], warn: Callable[[str], object]) -> ShadedMesh | None:
    """The object's triangles in m; None, and a word to `warn`, where they cannot be had."""
    try:
        triangles = read_stl(_content(shape, folders))
    except (BadStl, OSError, ValueError) as error:
        warn(f'mesh "{shape.path}" of the scene cannot be drawn: {error}')
        return None
    corners = (triangles.vertices * np.array(shape.scale))[triangles.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    faces = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
    return ShadedMesh(corners.reshape(-1, 3), np.repeat(normals, 3, axis=0), faces)


def _content(shape: MeshShape, folders: Sequence[Path]) -> bytes:
    """As the planner finds it: the first of `folders` that has the file, or the message itself."""
    if not shape.path:
        return shape.data
    paths = [folder / shape.path for folder in folders]
    return next((path for path in paths if path.is_file()), paths[0]).read_bytes()
