"""A xacro file expanded without ROS: its arguments as a person gives them, its packages where an export has them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path

from gemelo.libraries.arm.errors import nearest, wrong_file
from gemelo.libraries.robot_import.xacro_sandbox.keeper import Confined, Failed, expand
from gemelo.schemas.reasons import Reason, because

SUFFIX = ".xacro"
UNDEFINED = re.compile(r"Undefined substitution argument (\S+)")


def expanded(
    path: Path,
    root: Path,
    arguments: Mapping[str, str],
    find: Callable[[str], Path],
    say: Callable[[Reason], str] = str,
) -> str:
    """The URDF's text, in the lines that `xacro` prints; it is given files of the folder `root`, and of the packages
    for which `find` gives a folder or raises `DescriptionError`, as this does for a file that is refused, for an
    argument that it does not have, and without the package `xacro`.
    """
    if find_spec("xacro") is None:
        raise wrong_file(path, because("import.xacro.not_installed"))
    try:
        expansion = expand(path, arguments, Confined(path, root, find))
    except Failed as failed:
        raise wrong_file(path, _why(failed)) from failed
    for note in expansion.notes:
        print(f"  {say(because('import.xacro.note', file=path.name, text=note))}")
    for name in arguments:
        if name not in expansion.known:
            known = nearest(name, expansion.known)
            raise wrong_file(path, because("import.xacro.argument", known, name=name))
    return expansion.text


def _why(failed: Failed) -> Reason:
    undefined = UNDEFINED.search(failed.text)
    if undefined:
        return because("import.xacro.no_default", name=undefined[1])
    if failed.kind == "RecursionError":
        return because("import.xacro.nested")
    return because("import.xacro.failed", problem=failed.text or failed.kind)


def outermost(files: Iterable[Path]) -> list[Path]:
    """Those that no other of them includes; all where each is included."""
    files = list(files)
    texts = {file: file.read_text(encoding="utf-8", errors="replace") for file in files}

    def is_included(file: Path) -> bool:
        include = re.compile(rf'<xacro:include\s[^>]*filename="([^"]*/)?{re.escape(file.name)}"')
        return any(other != file and include.search(text) for other, text in texts.items())

    return [file for file in files if not is_included(file)] or files
