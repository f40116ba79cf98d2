"""Names that a person gives to points and programs, and the files that are made of them."""

from __future__ import annotations

import unicodedata
from pathlib import Path

from gemelo.api.errors import BadArgument
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.schemas import text_file
from gemelo.schemas.reasons import because

LONGEST = 64  # [characters] of a name
LARGEST_FILE = 1_000_000  # [bytes] of a file of points or of a program
POINTS_END = ".points"  # of `<robot>.points.toml`, which is no program


def point_name(name: str) -> str:
    """A name for a point: any text up to 64 characters that can be seen; raises `BadArgument`."""
    return _name("point", name)


def program_name(name: str) -> str:
    """A name for a program, which is also that of its file; raises `BadArgument`."""
    _name("program", name)
    if wrong := sorted(set(name) & set('/\\:*?"<>|')):
        raise BadArgument(because("program.name.characters", name=name, characters=" ".join(wrong)))
    if name.startswith(".") or name.endswith((POINTS_END, ".")):
        raise BadArgument(because("program.name.end", name=name, end=POINTS_END))
    return name


def checked_folder(folder: str | Path) -> Path:
    """The path of a folder, which need not exist yet; raises `BadArgument` for what can be none."""
    if "\0" in str(folder):
        raise BadArgument(because("program.folder.nul", folder=str(folder)))
    path = Path(folder).expanduser().absolute()
    if path.exists() and not path.is_dir():
        raise BadArgument(because("program.folder.file", folder=str(path)))
    return path


def read_text(path: Path) -> str:
    """The text of a file; raises `ProgramError`."""
    try:
        if path.is_file() and (size := path.stat().st_size) > LARGEST_FILE:
            why = because("file.size", size=size, limit=LARGEST_FILE)
            raise ProgramError([Mistake(str(path), 0, (), why)])
        return text_file.read_text(path)
    except OSError as error:
        why = because("file.unreadable", error=error.strerror or str(error))
        raise ProgramError([Mistake(str(path), 0, (), why)]) from error
    except text_file.NotUtf8 as error:
        raise ProgramError([Mistake(str(path), 0, (), error.reason)]) from error


def _name(kind: str, name: str) -> str:
    if not isinstance(name, str) or not name.strip():
        raise BadArgument(because("program.name.missing", kind=kind))
    if name != name.strip():
        raise BadArgument(because("program.name.blank", kind=kind, name=name))
    if len(name) > LONGEST:
        raise BadArgument(because("program.name.long", kind=kind, name=name[:LONGEST], count=len(name), limit=LONGEST))
    if bad := next((each for each in name if unicodedata.category(each)[0] == "C"), None):
        raise BadArgument(because("program.name.control", kind=kind, name=name, character=bad))
    return name
