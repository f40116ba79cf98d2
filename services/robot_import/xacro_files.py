"""A xacro file expanded without ROS: its arguments as a person gives them, its packages where an export has them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from services.arm.errors import DescriptionError, suggestion

SUFFIX = ".xacro"
NO_XACRO = (
    "it is xacro, and the Python package `xacro` is not installed: run `make setup`, which brings it, "
    "or expand the file where ROS is (`xacro robot.urdf.xacro > robot.urdf`) and import that"
)
UNDEFINED = re.compile(r"Undefined substitution argument (\S+)")


class _Arguments(dict[str, str]):
    """Values by name; remembers each name that the file declares or uses."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


def expanded(path: Path, arguments: Mapping[str, str], find: Callable[[str], Path]) -> str:
    """The URDF's text, in the lines that `xacro` prints; `find` gives a package's folder or raises `DescriptionError`,
    as this does for a file that is refused, for an argument that it does not have, and without the package `xacro`.
    """
    try:
        import xacro  # slow to load, for xacro files alone
        from xacro import substitution_args
    except ImportError:
        raise DescriptionError(f"{path}: {NO_XACRO}") from None
    installed, given = substitution_args._eval_find, _Arguments(arguments)
    refused: list[DescriptionError] = []  # xacro wraps what is raised in it, and says it twice

    def found(package: str) -> str:
        try:
            return str(find(package))
        except DescriptionError as error:
            refused.append(error)
            raise

    substitution_args._eval_find = found  # else it asks ROS where it is
    try:
        text = str(xacro.process_file(str(path), mappings=given).toprettyxml(indent="  "))
    except DescriptionError:
        raise
    except Exception as error:  # xacro's own, and those of Python expressions in it
        if refused:
            raise refused[0] from error
        raise DescriptionError(f"{path}: {_said(error)}") from error
    finally:
        substitution_args._eval_find = installed
    for name in arguments:
        if name not in given.known:
            raise DescriptionError(f'{path}: it has no xacro argument "{name}"{suggestion(name, given.known)}')
    return text


def _said(error: Exception) -> str:
    undefined = UNDEFINED.search(str(error))
    if undefined:
        return f"its xacro argument {undefined[1]} has no default: give `gemelo import` --xacro {undefined[1]}:=VALUE"
    return f"xacro cannot expand it: {type(error).__name__}: {error}"


def outermost(files: Iterable[Path]) -> list[Path]:
    """Those that no other of them includes; all where each is included."""
    files = list(files)
    texts = {file: file.read_text(encoding="utf-8", errors="replace") for file in files}

    def is_included(file: Path) -> bool:
        include = re.compile(rf'<xacro:include\s[^>]*filename="([^"]*/)?{re.escape(file.name)}"')
        return any(other != file and include.search(text) for other, text in texts.items())

    return [file for file in files if not is_included(file)] or files
