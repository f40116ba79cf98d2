"""Reader of a program's text: gives the program, and every mistake in its form."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any

import msgspec

from gemelo.api.gripping import CLOSE, OPEN
from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.toml_lines import Where, nearest_line, toml_lines
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import read_text
from gemelo.programs.program import VERSION, Program, step_place
from gemelo.programs.steps import KINDS, AnyStep, Repeat, Step, StepPath, Wait
from gemelo.programs.values import DEEPEST, MOST_STEPS, wrong_values

UNITS = {"m": ("m", 1.0), "cm": ("m", 0.01), "mm": ("m", 0.001), "rad": ("rad", 1.0), "deg": ("rad", math.pi / 180.0),
         "s": ("s", 1.0), "ms": ("s", 0.001), "min": ("s", 60.0), "m/s": ("m/s", 1.0), "mm/s": ("m/s", 0.001),
         "%": ("%", 0.01)}  # fmt: skip
MEASURED = {"position": "m", "offset": "m", "through": "m", "center": "m", "blend": "m", "rpy": "rad",
            "tool_speed": "m/s", "to": "m",
            "time": "s", "timeout": "s", "share": "%", "joints": "rad or m"}  # fmt: skip
EXPECTED = {
    str: 'a text in quotes, as "ready"',
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    float | None: "a number",
    dict[str, float]: "numbers by joint, as {elbow = 0.5}",
    tuple[float, float, float] | None: "three numbers, as [0.25, 0.15, 0.1]",
    tuple[float, float, float, float] | None: "four numbers, as [0, 0, 0, 1]",
    str | float: '"open", "close" or a length',
    tuple[str, ...]: 'texts, as ["link_1", "link_2"]',
}
BY_KIND = {str(kind.__struct_config__.tag): kind for kind in KINDS}
NOTHING = Wait(time=0.0)  # stands where a step could not be read, so that the numbers of the others stay


def read_program(path: Path) -> Program:
    """The program of a file; raises `ProgramError` with all mistakes that can be seen without the robot."""
    program, mistakes = parse_program(path.name.removesuffix(".toml"), read_text(path), path)
    mistakes += value_mistakes(program)
    if mistakes:
        raise ProgramError(sorted(mistakes, key=lambda each: each.line))
    return program


def value_mistakes(program: Program) -> list[Mistake]:
    """What is wrong with the numbers of its steps by themselves."""
    return [program.mistake(path, *wrong) for path, step in program.all_steps() for wrong in wrong_values(step)]


def parse_program(name: str, text: str, path: Path | None = None) -> tuple[Program, list[Mistake]]:
    """As much of the program as can be read, and the mistakes of its form; raises `ProgramError` if it is no TOML."""
    data = load_toml(text, str(path or name))
    reader = _Reader(str(path or name), toml_lines(text))
    steps, robot = reader.program(data)
    return Program(name, steps, robot, path, reader.lines), reader.mistakes


def load_toml(text: str, file: str) -> dict[str, Any]:
    """Raises `ProgramError` with the line."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ProgramError([Mistake(file, 0, (), "this is nested far too deep")]) from None
    except tomllib.TOMLDecodeError as error:
        at = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
        line = int(at[1]) if at else text.rstrip().count("\n") + 1
        said = str(error)[: at.start()] if at else str(error).removesuffix(" (at end of document)")
        what = f"this is not TOML: {said}{f' (column {at[2]})' if at else ' (at the end)'}"
        raise ProgramError([Mistake(file, line, (), what)]) from None


class _Reader:
    """Collects the mistakes of one file."""

    def __init__(self, file: str, lines: Mapping[Where, int]) -> None:
        self.file, self.lines = file, lines
        self.mistakes: list[Mistake] = []
        self._count = 0

    def program(self, data: dict[str, Any]) -> tuple[tuple[AnyStep, ...], str]:
        """Its steps and its robot."""
        known = ("version", "robot", "steps")
        for key in data:
            if key not in known:
                self._say((key,), (), f'unknown key "{key}"{suggestion(key, known)}')
        version, robot = data.get("version"), data.get("robot", "")
        if version != VERSION or isinstance(version, bool | float):
            said = f"version = {version!r}" if "version" in data else "no version is given"
            self._say(("version",), (), f"{said}: this gemelo reads version = {VERSION}")
        if not isinstance(robot, str):
            self._say(("robot",), (), f"robot = {robot!r} is not {EXPECTED[str]}")
        steps = self._steps(data.get("steps", []), ())
        return steps, robot if isinstance(robot, str) else ""

    def _steps(self, given: object, around: StepPath) -> tuple[AnyStep, ...]:
        place = (*step_place(around), "steps")
        if not isinstance(given, list):
            self._say(
                place, around, f'steps = {_shown(given)} is no list of steps, as [{{do = "go", state = "ready"}}]'
            )
            return ()
        if len(around) > DEEPEST:
            self._say(place, around, f"repeats are nested more than {DEEPEST} deep: make a program of it, and call it")
            return ()
        return tuple(self._step(each, (*around, index)) for index, each in enumerate(given))

    def _step(self, given: object, path: StepPath) -> AnyStep:
        self._count += 1
        place = step_place(path)
        if self._count == MOST_STEPS + 1:
            self._say(place, path, f"a program has at most {MOST_STEPS} steps: make several, and call them")
        if self._count > MOST_STEPS:
            return NOTHING
        if not isinstance(given, dict):
            self._say(place, path, f'{_shown(given)} is no step, as {{do = "go", state = "ready"}}')
            return NOTHING
        kind = BY_KIND.get(given["do"]) if isinstance(given.get("do"), str) else None
        if kind is None:
            self._say((*place, "do"), path, _unknown_kind(given))
            return NOTHING
        return self._of_kind(kind, given, path)

    def _of_kind(self, kind: type[Step], given: dict[str, Any], path: StepPath) -> AnyStep:
        place, is_right = step_place(path), True
        fields = {field.name: field for field in msgspec.structs.fields(kind)}
        for key in given:
            if key != "do" and key not in fields:
                is_right = self._say((*place, key), path, f'{given["do"]} has no key "{key}"{suggestion(key, fields)}')
        values: dict[str, Any] = {}
        for name, field in fields.items():
            if name in given:
                values[name] = self._field(kind, name, field.type, given[name], path)
                is_right = is_right and values[name] is not None
            elif field.required:
                expected = _expected(kind, name, field.type)
                is_right = self._say(place, path, f'{given["do"]} needs "{name}": {expected}')
        if not is_right:
            return NOTHING if kind is not Repeat else Repeat(count=1, steps=values.get("steps") or (NOTHING,))
        found: AnyStep = kind(**values)  # type: ignore[assignment]
        return found

    def _field(self, kind: type[Step], name: str, expected: Any, value: object, path: StepPath) -> object:
        if kind is Repeat and name == "steps":
            return self._steps(value, path)
        place = (*step_place(path), name)
        try:
            return msgspec.convert(_in_si(name, value), expected)
        except (msgspec.ValidationError, _BadUnit) as error:
            said = f": {error}" if isinstance(error, _BadUnit) else ""
            self._say(place, path, f"{name} = {_shown(value)} is not {_expected(kind, name, expected)}{said}")
            return None

    def _say(self, place: Where, path: StepPath, what: str) -> bool:
        """Keeps a mistake, at the line of the place or of what is around it; False."""
        line = nearest_line(self.lines, place)
        self.mistakes.append(Mistake(self.file, line, path, what))
        return False


class _BadUnit(Exception):
    """A number with a unit that its key does not take, or without the one that it needs."""


def _in_si(name: str, value: object) -> object:
    """The value with every text that is a number with a unit turned into a number, SI."""
    unit = MEASURED.get(name, "")
    if not unit or (name == "to" and value in (OPEN, CLOSE)):
        return value
    if isinstance(value, list):
        return [_number(each, unit) for each in value]
    if isinstance(value, dict):
        return {key: _number(each, unit) for key, each in value.items()}
    return _number(value, unit)


def _number(value: object, unit: str) -> object:
    if unit == "%" and isinstance(value, int | float) and not isinstance(value, bool):
        raise _BadUnit(f'write it in per cent: "{value if value > 1 else value * 100:g}%"')
    if not isinstance(value, str):
        return value
    found = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(\S+)\s*", value)
    base, factor = UNITS.get(found[2], ("", 1.0)) if found else ("", 1.0)
    if found is None or base not in unit.split(" or "):
        known = ", ".join(name for name, (base, _) in UNITS.items() if base in unit.split(" or "))
        raise _BadUnit(f"{value!r} has none of the units {known}")
    return float(Decimal(found[1]) / 100) if base == "%" else float(found[1]) * factor


def _expected(kind: type[Step], name: str, expected: Any) -> str:
    if name == "share":
        return 'a share in per cent, as "50%"'
    if kind is Repeat and name == "steps":
        return "a list of steps"
    unit = MEASURED.get(name)
    return EXPECTED.get(expected, "of that kind") + (f", in {unit} or with its unit" if unit else "")


def _unknown_kind(given: Mapping[str, Any]) -> str:
    if "do" not in given:
        return f"a step says what it does: do = one of {', '.join(BY_KIND)}"
    if not isinstance(given["do"], str):
        return f"do = {_shown(given['do'])} is not one of {', '.join(BY_KIND)}"
    return f'there is no step "{given["do"]}"{suggestion(given["do"], BY_KIND)}'


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
