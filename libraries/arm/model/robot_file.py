"""robot.toml, read strictly: an unknown key is an error with file, line, key and the nearest known one."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import get_args, get_origin, get_type_hints

import msgspec

from gemelo.libraries.arm.errors import nearest, wrong_file
from gemelo.libraries.arm.motors.speed import chosen_tick
from gemelo.libraries.toml_lines import Where, nearest_line, syntax_mistake, toml_lines
from gemelo.schemas import text_file
from gemelo.schemas.reasons import Reason, Remedy, because
from gemelo.schemas.robot import RobotFile

TAG_FIELD = "kind"  # of tables of which there are several kinds


@dataclass(frozen=True)
class UnknownKey:
    """A key that no type of schemas/robot.py has: `path` is where it stands, e.g. ("joint", 0, "motr")."""

    path: Where
    line: int  # 0 where it was not found
    near: Remedy  # what was probably meant

    @property
    def reason(self) -> Reason:
        """Without its place."""
        return because("file.key.unknown_at", self.near, key=dotted(self.path))


def read_robot_data(path: Path, text: str, kind: type[msgspec.Struct] = RobotFile) -> dict[str, object]:
    """The tables of robot.toml, whose keys are known and whose numbers are finite; raises `DescriptionError`.

    `kind` is the type of another file that is read as strictly.
    """
    data = parse_toml(path, text)
    for unknown in unknown_keys(data, text, kind):
        raise wrong_file(path, unknown.reason, unknown.line)
    for key, value in not_finite(data):
        raise wrong_file(path, because("file.value.not_finite", key=dotted(key), value=value), line_of(key, text))
    return data


def typed_robot(data: object) -> RobotFile:
    """The tables as types, with a tick rate; raises `msgspec.ValidationError`."""
    robot = msgspec.convert(data, RobotFile)
    if robot.device.tick_hz:
        return robot
    device = msgspec.structs.replace(robot.device, tick_hz=chosen_tick(robot))
    return msgspec.structs.replace(robot, device=device)


def read_text(path: Path) -> str:
    """The text of a file of the robot's folder; raises `DescriptionError` where there is none."""
    try:
        return text_file.read_text(path)
    except FileNotFoundError as error:
        raise wrong_file(path, because("file.none")) from error
    except text_file.NotUtf8 as error:
        raise wrong_file(path, error.reason) from error
    except OSError as error:
        raise wrong_file(path, because("file.unreadable", error=error.strerror or str(error))) from error


def parse_toml(path: Path, text: str) -> dict[str, object]:
    """The raw tables of robot.toml; raises `DescriptionError` with the parser's line."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        line, what = syntax_mistake(error, text)
        raise wrong_file(path, what, line) from error


def unknown_keys(data: dict[str, object], text: str, kind: type[msgspec.Struct] = RobotFile) -> list[UnknownKey]:
    """Every key of `data` that the types do not have."""
    return [UnknownKey(path, line_of(path, text), near) for path, near in _walk(data, kind, ())]


def not_finite(data: object, path: Where = ()) -> list[tuple[Where, float]]:
    """Every NaN and infinity in the TOML data with its key path; the values are dimensionless."""
    match data:
        case dict():
            return [found for key, value in data.items() for found in not_finite(value, (*path, key))]
        case list():
            return [found for index, value in enumerate(data) for found in not_finite(value, (*path, index))]
        case float() if not math.isfinite(data):
            return [(path, data)]
        case _:
            return []


def dotted(path: Where) -> str:
    """("joint", 0, "motor") as joint[0].motor."""
    text = ""
    for key in path:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else key
    return text


def line_of(place: Where, text: str) -> int:
    """The line, from 1, of a key of a TOML text, or of the nearest table around it that is written; 0 where there is
    none."""
    return nearest_line(toml_lines(text), place)


def _chosen(kind: object, data: object) -> object:
    """Of several tables that may stand there, the only one, or the one that its own `kind` names; else `kind`
    itself."""
    if not (isinstance(kind, UnionType) and isinstance(data, dict)):
        return kind
    options = [option for option in get_args(kind) if hasattr(option, "__struct_fields__")]
    if len(options) == 1:
        return options[0]
    return next((each for each in options if _tag_of(each).get(TAG_FIELD, "") == data.get(TAG_FIELD)), kind)


def _tag_of(kind: object) -> dict[str, object]:
    """The key that names the table's kind, where it has one, and its word."""
    config = getattr(kind, "__struct_config__", None)
    return {config.tag_field: config.tag} if config is not None and config.tag is not None else {}


def _walk(data: object, kind: object, path: Where) -> list[tuple[Where, Remedy]]:
    if get_origin(kind) is tuple and isinstance(data, list):
        item = get_args(kind)[0]
        return [found for index, entry in enumerate(data) for found in _walk(entry, item, (*path, index))]
    kind = _chosen(kind, data)
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct) and isinstance(data, dict)):
        return []
    types = get_type_hints(kind) | _tag_of(kind)
    found: list[tuple[Where, Remedy]] = []
    for key, value in data.items():
        if key in types:
            found += _walk(value, types[key], (*path, key))
        else:
            found.append(((*path, key), nearest(key, types)))
    return found
