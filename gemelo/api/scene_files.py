"""The files of a scene: meshes to put into it, and whole scenes."""

from __future__ import annotations

from pathlib import Path

import msgspec

from gemelo.api.errors import BadArgument, Error
from gemelo.api.targets import number
from gemelo.api.whole_files import write_whole
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import MeshShape, PlanningScene
from gemelo.schemas.text_file import read_text

LARGEST_MESH = 10.0  # [m]; what is larger was drawn in mm
LARGEST_UNSAID = 3.0  # [m] of a mesh for which no scale is given: larger than what such arms reach


def load_mesh(path: str | Path, scale: float | None = None) -> MeshShape:
    """The shape of an STL file, `scale` [m] to its unit, else in metres: by its path in the project, or by its content.

    A path inside the project is found by every process there. Raises `BadArgument` where the file cannot be read, or
    would be longer than 10 m; than 3 m where no scale is given, since it may be in another unit.

    >>> gemelo.load_mesh("tests/gemelo/wedge.stl", scale=0.001).scale
    (0.001, 0.001, 0.001)
    """
    file = Path(path)
    if not file.is_file():
        raise BadArgument(because("argument.mesh.no_file", path=str(path)))
    try:
        content = file.read_bytes()
    except OSError as error:
        raise BadArgument(because("argument.mesh.unreadable", path=str(path), error=str(error.strerror))) from error
    _require_size(file, content, None if scale is None else number("scale", scale))
    metres = 1.0 if scale is None else scale
    inside = file.resolve()
    if inside.is_relative_to(project_root()):
        return MeshShape(path=str(inside.relative_to(project_root())), scale=(metres,) * 3)
    return MeshShape(data=content, scale=(metres,) * 3)


def _require_size(path: Path, content: bytes, scale: float | None) -> None:
    """Refuses what is far too large; what is no mesh at all the planner says."""
    from gemelo.libraries.arm.stl import BadStl, read_stl  # numpy takes half of the time of `import gemelo`

    try:
        vertices = read_stl(content).vertices
    except BadStl:
        return
    longest = (1.0 if scale is None else scale) * float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    if longest > LARGEST_MESH:
        raise BadArgument(because("argument.mesh.long", remedy("scale_of_millimetres"), path=str(path), size=longest))
    if scale is None and longest > LARGEST_UNSAID:
        raise BadArgument(because("argument.mesh.long", remedy("scale_of_its_unit"), path=str(path), size=longest))


def write_scene(scene: PlanningScene, path: Path) -> None:
    """Writes the scene as JSON, and makes the file's folder; raises `Error` where the file cannot be written."""
    write_whole(path, msgspec.json.format(msgspec.json.encode(scene)) + b"\n")


def read_scene(path: Path) -> PlanningScene:
    """The scene of a file; raises `Error` where it cannot be read, or holds none."""
    try:
        return msgspec.json.decode(read_text(path), type=PlanningScene)
    except OSError as error:
        raise Error(because("client.file.unreadable", path=str(path), error=str(error.strerror))) from error
    except ValueError as error:
        raise Error(because("client.scene.no_file", path=str(path), error=str(error))) from error
