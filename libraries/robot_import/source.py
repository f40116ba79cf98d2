"""The URDF of a CAD export, and the files that its mesh references mean: ROS 1 and 2 packages, plain folders, xacro."""

from __future__ import annotations

import codecs
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from gemelo.libraries.arm.errors import nearest_name, wrong_file
from gemelo.libraries.robot_import.xacro_files import SUFFIX, expanded, outermost
from gemelo.schemas.reasons import Reason, because

BESIDE = 2  # innermost folders, whose meshes are the file's own without a package
DEPTH = 4  # folders below a package in which its configuration may be
PACKAGE = "package.xml"  # of ROS
UP = 6  # folders above the URDF in which its package may be
ENCODING = re.compile(rb"<\?xml[^>]*?\bencoding\s*=\s*[\"']([A-Za-z0-9._-]+)")
SEMANTIC = ".srdf"  # in the name of an SRDF, also of one in xacro
LONGEST_DECLARATION = 200  # [B]
UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True)
class RobotSource:
    """A URDF's text, expanded where it was xacro, and the folder to look for its meshes in."""

    urdf: Path
    root: Path
    text: str
    is_expanded: bool = False

    def beside(self, *endings: str) -> list[Path]:
        """The files with these endings of the same package, or of a MoveIt package beside it, from near to far."""
        folders = [self.urdf.absolute().parent, self.root.absolute()]
        if (self.root / PACKAGE).is_file():
            folders += sorted(each.parent for each in self.root.absolute().parent.glob(f"*moveit*/{PACKAGE}"))
        found: dict[Path, int] = {}
        for folder in folders:
            is_package = folder != self.urdf.absolute().parent or (folder / PACKAGE).is_file()
            for depth in range(DEPTH if is_package else BESIDE):
                for path in sorted(folder.glob("*/" * depth + "*")):
                    if path.is_file() and path.name.lower().endswith(endings):
                        found.setdefault(path, len(found))
        return list(found)

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

    def in_another_format(self, reference: str) -> Path | None:
        """The only mesh file that differs from the one meant in its ending alone; None where there is none, or more."""
        wanted = unquote(Path(reference.replace("\\", "/")).stem).lower()
        alike = [path for path in _files(self.root) if _is_mesh(path) and path.stem.lower() == wanted]
        return alike[0] if len(alike) == 1 else None

    def missing(self, reference: str) -> Reason:
        """That a mesh is not there, with the file of the most similar name; or those of the same one, of which any
        could be meant."""
        name = Path(unquote(reference.replace("\\", "/"))).name
        meshes = [path for path in _files(self.root) if _is_mesh(path)]
        for is_name in (True, False):
            wanted = name.lower() if is_name else Path(name).stem.lower()
            alike = [path for path in meshes if (path.name if is_name else path.stem).lower() == wanted]
            same = tuple(str(path.relative_to(self.root)) for path in alike)
            if same:
                return because("mend.mesh.several", mesh=reference, count=len(same), files=same)
        near = nearest_name(name, [path.name for path in meshes])
        if near:
            return because("mend.mesh.near", mesh=reference, name=near)
        if meshes:
            return because("mesh.none", mesh=reference)
        return because("mend.mesh.none_at_all", mesh=reference, folder=str(self.root))

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


def find_source(
    given: Path,
    arguments: Mapping[str, str] | None = None,
    ask: Callable[[Path], None] = lambda urdf: None,
    say: Callable[[Reason], str] = str,
) -> RobotSource:
    """The source at a URDF, a xacro file with `arguments`, or an export's folder; raises `DescriptionError`.

    `ask` is called before a xacro file is expanded, and raises it where that is not wanted; `say` makes the sentence of
    what the file prints.
    """
    if not given.exists():
        raise wrong_file(given, because("import.source.none"))
    urdf, root = (_urdf_in(given), given) if given.is_dir() else (given, _root_of(given))
    text = _decoded(urdf)
    if urdf.suffix.lower() == SUFFIX or "<xacro:" in text:
        ask(urdf)
        expansion = expanded(urdf, root, arguments or {}, lambda package: _found_package(package, urdf), say)
        return RobotSource(urdf, root, expansion, is_expanded=True)
    if arguments:
        raise wrong_file(urdf, because("import.xacro.none", names=tuple(arguments)))
    return RobotSource(urdf, root, text)


def _root_of(urdf: Path) -> Path:
    """The folder of the export that holds the file: the nearest that is a package, or has meshes beside or above the
    file; else the file's own. All of it is looked through, so a person's home with a folder of meshes is none."""
    above = _above(urdf)
    packages = (folder for folder in above if (folder / PACKAGE).is_file())
    near = (folder for folder in above[:BESIDE] if (folder / "meshes").is_dir())
    return next(packages, None) or next(near, urdf.parent)


def _urdf_in(folder: Path) -> Path:
    """The only URDF; or, where there is none, the only xacro file that is a robot."""
    urdfs = [path for path in _files(folder) if path.suffix.lower() == ".urdf"]
    xacros = (path for path in _files(folder) if path.suffix.lower() == SUFFIX and _is_robot(path))
    found = urdfs or outermost(xacros)
    if not found:
        raise wrong_file(folder, because("import.source.no_robot"))
    if len(found) > 1:
        names = tuple(str(path.relative_to(folder)) for path in found[:6])
        raise wrong_file(folder, because("import.source.several", count=len(found), names=names))
    return found[0]


def _is_robot(path: Path) -> bool:
    """True if it is a robot's own file, and neither one with macros for others nor an SRDF."""
    text = path.read_text(encoding="utf-8", errors="replace")
    if SEMANTIC in path.name.lower() or ("<link" not in text and re.search(r"<(group|disable_collisions)\b", text)):
        return False
    return re.search(r"<robot\b[^>]*\bname\s*=", text) is not None and ("<link" in text or "<xacro:" in text)


def _decoded(urdf: Path) -> str:
    """The text in the encoding that its first line names, else in UTF-8; no blank before that line, as no XML has any.

    Raises `DescriptionError`.
    """
    try:
        raw = urdf.read_bytes()
    except OSError as error:
        raise wrong_file(urdf, because("file.unreadable", error=error.strerror or str(error))) from error
    named = ENCODING.search(raw[:LONGEST_DECLARATION])
    encoding = "utf-16" if raw.startswith(UTF_16) else named[1].decode() if named else "utf-8-sig"
    try:
        text = raw.decode("utf-8-sig" if encoding.lower() == "utf-8" else encoding)
    except (UnicodeDecodeError, LookupError) as error:
        raise wrong_file(urdf, because("import.source.letters", encoding=encoding, error=str(error))) from error
    blanks = re.match(r"(\s+)<\?xml[^>]*\?>", text)
    return text if blanks is None else blanks[1] + text[blanks.end() :]


def _found_package(package: str, path: Path) -> Path:
    """The folder that `$(find package)` in the file at `path` means; raises `DescriptionError`."""
    above = _above(path)
    for folder in _package_folders(package, above):
        if folder.is_dir():
            return folder
    raise wrong_file(path, because("import.xacro.package", package=package, folders=tuple(map(str, above))))


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
        return ET.parse(folder / PACKAGE).getroot().findtext("name", "").strip()
    except (OSError, ET.ParseError):
        return ""


def _files(folder: Path) -> list[Path]:
    """All that are not hidden, sorted."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def _is_mesh(path: Path) -> bool:
    return path.suffix.lower() in (".stl", ".obj", ".dae", ".glb", ".gltf", ".ply")
