"""Names that a person gives to points and programs, and the files that are made of them."""

from __future__ import annotations

import unicodedata
from pathlib import Path

from gemelo.api.errors import BadArgument, Error
from gemelo.schemas import text_file

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
        raise BadArgument(f"the program's name {name!r} has {' '.join(wrong)} in it: it becomes the name of a file")
    if name.startswith(".") or name.endswith((POINTS_END, ".")):
        raise BadArgument(f"the program's name {name!r} must not begin or end with a dot, nor end with {POINTS_END}")
    return name


def checked_folder(folder: str | Path) -> Path:
    """The path of a folder, which need not exist yet; raises `BadArgument` for what can be none."""
    if "\0" in str(folder):
        raise BadArgument(f"folder cannot be {str(folder)!r}: no path has a NUL in it")
    path = Path(folder).expanduser().absolute()
    if path.exists() and not path.is_dir():
        raise BadArgument(f"{path} is a file: the folder of programs is to be a folder")
    return path


def read_text(path: Path) -> str:
    """The text of a file; raises `Error` with one sentence."""
    try:
        if path.is_file() and path.stat().st_size > LARGEST_FILE:
            raise Error(f"{path} has {path.stat().st_size} bytes: no file of points or program is over {LARGEST_FILE}")
        return text_file.read_text(path)
    except OSError as error:
        raise Error(f"{path} cannot be read: {error.strerror}") from error
    except text_file.NotUtf8 as error:
        raise Error(f"{path} is no UTF-8 text: {error}") from error


def _name(kind: str, name: str) -> str:
    if not isinstance(name, str) or not name.strip():
        raise BadArgument(f"a {kind} needs a name")
    if name != name.strip():
        raise BadArgument(f"the {kind}'s name {name!r} begins or ends with a blank")
    if len(name) > LONGEST:
        raise BadArgument(f"the {kind}'s name {name[:LONGEST]!r}... has {len(name)} characters, more than {LONGEST}")
    if bad := next((each for each in name if unicodedata.category(each)[0] == "C"), None):
        raise BadArgument(f"the {kind}'s name {name!r} has the control character {bad!r} in it")
    return name
