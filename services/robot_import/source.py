"""The URDF of a CAD export, and the files that its mesh references mean: ROS 1 and 2 packages, plain folders, xacro."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from services.arm.errors import DescriptionError, suggestion
from services.arm.model.robot_file import read_text

UP = 6  # folders above the URDF in which its package may be
XACRO = ".xacro"
MOST_NAMED = 3  # files of one name
NO_XACRO = (
    "it is xacro, and the Python package `xacro` is not installed: run `make setup`, which brings it, "
    "or expand the file where ROS is (`xacro robot.urdf.xacro > robot.urdf`) and import that"
)


@dataclass(frozen=True)
class Source:
    """A URDF's text, expanded where it was xacro, and the folder to look for its meshes in."""

    urdf: Path
    root: Path
    text: str
    is_expanded: bool = False

    @property
    def label(self) -> str:
        """The name to which lines of the text belong."""
        return f"{self.urdf.name}, expanded" if self.is_expanded else self.urdf.name

    def find(self, reference: str) -> Path | None:
        """The file that a mesh's `filename` means, None where there is none or several could be meant."""
        for path in self._candidates(unquote(reference.replace("\\", "/"))):
            if path.is_file():
                return path
        name = Path(reference.replace("\\", "/")).name
        alike = [path for path in _files(self.root) if path.name.lower() in (name.lower(), unquote(name).lower())]
        return alike[0] if len(alike) == 1 else None

    def near(self, reference: str) -> str:
        """A hint at the file with the most similar name; or at those of the same one, of which any could be meant."""
        name, meshes = Path(reference).name, [path for path in _files(self.root) if _is_mesh(path)]
        same = [str(path.relative_to(self.root)) for path in meshes if path.name.lower() == name.lower()]
        if same:
            more = f" and {len(same) - MOST_NAMED} more" if len(same) > MOST_NAMED else ""
            return f", and {len(same)} have that name: {', '.join(same[:MOST_NAMED])}{more}"
        return suggestion(name, [path.name for path in meshes])

    def _candidates(self, reference: str) -> Iterator[Path]:
        scheme, _, rest = reference.rpartition("://")
        above = (*_above(self.urdf), self.root)
        if scheme in ("package", "model"):
            package, _, inside = rest.partition("/")
            yield from (folder / inside for folder in _package_folders(package, above))
            yield from (folder / inside for folder in above)
        elif scheme == "file":
            yield Path(rest if rest.startswith("/") else f"/{rest}")
            yield self.urdf.parent / rest.lstrip("/")
        else:
            yield from (folder / reference for folder in above)


def find_source(given: Path) -> Source:
    """The source at a URDF, a xacro file or an export's folder; raises `DescriptionError`."""
    if given.is_file():
        return _source(given, _root_of(given))
    if not given.is_dir():
        raise DescriptionError(f"{given}: there is no such file or folder")
    return _source(_urdf_in(given), given)


def _root_of(urdf: Path) -> Path:
    """The folder of the export that holds the file: the nearest with a package.xml or meshes, else the file's own."""
    holds = (folder for folder in _above(urdf) if (folder / "package.xml").is_file() or (folder / "meshes").is_dir())
    return next(holds, urdf.parent)


def _urdf_in(folder: Path) -> Path:
    """The only URDF; or, where there is none, the only xacro file that is a robot."""
    urdfs = [path for path in _files(folder) if path.suffix.lower() == ".urdf"]
    found = urdfs or [path for path in _files(folder) if path.suffix.lower() == XACRO and _is_robot(path)]
    if not found:
        raise DescriptionError(f"{folder}: there is no .urdf and no .xacro of a robot in it")
    if len(found) > 1:
        names = ", ".join(str(path.relative_to(folder)) for path in found[:6])
        raise DescriptionError(f"{folder}: there are {len(found)} robots in it ({names}): name one of these files")
    return found[0]


def _is_robot(path: Path) -> bool:
    """True if it is a robot's own file, and not one with macros for others."""
    text = path.read_text(encoding="utf-8", errors="replace")
    return re.search(r"<robot\b[^>]*\bname\s*=", text) is not None and ("<link" in text or "<xacro:" in text)


def _source(urdf: Path, root: Path) -> Source:
    text = read_text(urdf)
    if urdf.suffix.lower() == XACRO or "<xacro:" in text:
        return Source(urdf, root, _expanded(urdf), is_expanded=True)
    return Source(urdf, root, text)


def _expanded(path: Path) -> str:
    """By the package `xacro`; raises `DescriptionError` where it is not installed or refuses the file."""
    try:
        import xacro
        from xacro import substitution_args
    except ImportError:
        raise DescriptionError(f"{path}: {NO_XACRO}") from None
    installed = substitution_args._eval_find
    refused: list[DescriptionError] = []  # xacro wraps what is raised in it, and says it twice

    def find(package: str) -> str:
        try:
            return str(_found_package(package, path))
        except DescriptionError as error:
            refused.append(error)
            raise

    substitution_args._eval_find = find  # else it asks ROS where it is
    try:
        return str(xacro.process_file(str(path)).toprettyxml(indent="  "))  # its lines as `xacro` prints them
    except DescriptionError:
        raise
    except Exception as error:  # xacro's own, and those of Python expressions in it
        if refused:
            raise refused[0] from error
        raise DescriptionError(f"{path}: xacro cannot expand it: {type(error).__name__}: {error}") from error
    finally:
        substitution_args._eval_find = installed


def _found_package(package: str, path: Path) -> Path:
    """The folder that `$(find package)` in the file at `path` means; raises `DescriptionError`."""
    above = _above(path)
    for folder in _package_folders(package, above):
        if folder.is_dir():
            return folder
    looked_in = ", ".join(str(folder) for folder in above)
    raise DescriptionError(
        f'{path}: $(find {package}): there is no package "{package}" in {looked_in}: copy its folder into one of them'
    )


def _above(path: Path) -> tuple[Path, ...]:
    """The folders of which one may be the file's package, the innermost first."""
    return tuple(path.absolute().parents[: UP + 1])


def _package_folders(package: str, above: tuple[Path, ...]) -> Iterator[Path]:
    """Where the ROS package of that name may lie: one of these folders, or a folder in one of them."""
    yield from (folder for folder in above if package in (folder.name, _package_name(folder)))
    yield from (folder / package for folder in above)


def _package_name(folder: Path) -> str:
    """Of the package.xml there; "" where there is none."""
    try:
        return ET.parse(folder / "package.xml").getroot().findtext("name", "").strip()
    except (OSError, ET.ParseError):
        return ""


def _files(folder: Path) -> list[Path]:
    """All that are not hidden, sorted."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def _is_mesh(path: Path) -> bool:
    return path.suffix.lower() in (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
