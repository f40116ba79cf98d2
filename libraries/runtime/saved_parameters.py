"""Parameters that a node keeps for its later starts: a TOML file of its own, `<paths.run>/parameters/<node>.toml`."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.toml_lines import Where, nearest_line, toml_lines
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.system import ParameterValue
from gemelo.schemas.text_file import NotUtf8, read_text

FOLDER = "parameters"
HEAD = "# As `gemelo param set --save` has left them; without this file the node starts as its deployment says.\n"
_LINE = re.compile(r"at line (\d+)")


class SavedParameters:
    """The file of one node."""

    def __init__(self, run_dir: Path, node: str) -> None:
        self.path = run_dir / FOLDER / f"{node}.toml"
        self._lines: dict[Where, int] = {}

    def read(self) -> dict[str, ParameterValue]:
        """The values by name, none where there is no file; raises `RequestRefused` with the line that is wrong."""
        try:
            text = read_text(self.path)
        except FileNotFoundError:
            return {}
        except (OSError, NotUtf8) as error:
            why = error.reason if isinstance(error, NotUtf8) else plain(str(error))
            raise RequestRefused(because("parameter.file.unreadable", why, file=str(self.path))) from error
        try:
            values = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            found = _LINE.search(str(error))
            where = f", line {found[1]}" if found else ""
            raise RequestRefused(because("parameter.from", plain(str(error)), origin=f"{self.path}{where}")) from error
        self._lines = toml_lines(text)
        for name, value in values.items():
            if not isinstance(value, bool | int | float | str):
                wrong = because("parameter.file.value", name=name, value=repr(value))
                raise RequestRefused(because("parameter.from", wrong, origin=f"{self.path}{self.line(name)}"))
        return values

    def line(self, name: str) -> str:
        """`, line 3`: where the file had the parameter when it was read; empty where it did not."""
        line = nearest_line(self._lines, (name,))
        return f", line {line}" if line else ""

    def keep(self, values: Mapping[str, ParameterValue]) -> None:
        """Writes the file anew; raises `RequestRefused` where it cannot."""
        beside = self.path.with_suffix(".tmp")
        text = HEAD + "".join(f"{toml(name)} = {toml(value)}\n" for name, value in values.items())
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            beside.write_text(text, encoding="utf-8")
            os.replace(beside, self.path)
        except OSError as error:
            said = str(error.strerror or error)
            raise RequestRefused(because("parameter.file.unwritable", file=str(self.path), error=said)) from error


def toml(value: ParameterValue) -> str:
    """A value, or a name in quotes, as TOML has it."""
    # JSON's escapes are TOML's, except that of DEL, which JSON leaves as it is.
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
