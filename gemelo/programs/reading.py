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
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.toml_lines import Where, nearest_line, syntax_mistake, toml_lines
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.names import read_text
from gemelo.programs.program import VERSION, Program, step_place
from gemelo.programs.steps import KINDS, AnyStep, Repeat, Step, StepPath, Wait
from gemelo.programs.values import DEEPEST, MOST_STEPS, wrong_values
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because

UNITS = {"m": ("m", 1.0), "cm": ("m", 0.01), "mm": ("m", 0.001), "rad": ("rad", 1.0), "deg": ("rad", math.pi / 180.0),
         "s": ("s", 1.0), "ms": ("s", 0.001), "min": ("s", 60.0), "m/s": ("m/s", 1.0), "mm/s": ("m/s", 0.001),
         "%": ("%", 0.01)}  # fmt: skip
MEASURED = {"position": "m", "offset": "m", "through": "m", "center": "m", "blend": "m", "rpy": "rad",
            "tool_speed": "m/s", "to": "m",
            "time": "s", "timeout": "s", "share": "%", "joints": "rad or m"}  # fmt: skip
EXPECTED = {  # by type, what the catalogue calls it
    str: "expected.text",
    bool: "expected.boolean",
    int: "expected.integer",
    float: "expected.number",
    float | None: "expected.number",
    dict[str, float]: "expected.by_joint",
    tuple[float, float, float] | None: "expected.three",
    tuple[float, float, float, float] | None: "expected.four",
    str | float: "expected.opening",
    tuple[str, ...]: "expected.texts",
}
A_STEP = '{do = "go", state = "ready"}'
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
        raise ProgramError([Mistake(file, 0, (), because("file.toml.nested"))]) from None
    except tomllib.TOMLDecodeError as error:
        line, what = syntax_mistake(error, text)
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
                self._add((key,), (), because("file.key.unknown", nearest(key, known), key=key))
        version, robot = data.get("version"), data.get("robot", "")
        if "version" not in data:
            self._add(("version",), (), because("file.version.none", known=VERSION))
        elif version != VERSION or isinstance(version, bool | float):
            self._add(("version",), (), because("file.version.other", value=_shown(version), known=VERSION))
        if not isinstance(robot, str):
            wrong = because("program.value.kind", key="robot", value=_shown(robot), expected=EXPECTED[str])
            self._add(("robot",), (), wrong)
        steps = self._steps(data.get("steps", []), ())
        return steps, robot if isinstance(robot, str) else ""

    def _steps(self, given: object, around: StepPath) -> tuple[AnyStep, ...]:
        place = (*step_place(around), "steps")
        if not isinstance(given, list):
            self._add(place, around, because("program.steps.kind", value=_shown(given), example=f"[{A_STEP}]"))
            return ()
        if len(around) > DEEPEST:
            self._add(place, around, because("program.repeat.nested", limit=DEEPEST))
            return ()
        return tuple(self._step(each, (*around, index)) for index, each in enumerate(given))

    def _step(self, given: object, path: StepPath) -> AnyStep:
        self._count += 1
        place = step_place(path)
        if self._count == MOST_STEPS + 1:
            self._add(place, path, because("program.steps.many", limit=MOST_STEPS))
        if self._count > MOST_STEPS:
            return NOTHING
        if not isinstance(given, dict):
            self._add(place, path, because("program.step.kind", value=_shown(given), example=A_STEP))
            return NOTHING
        kind = BY_KIND.get(given["do"]) if isinstance(given.get("do"), str) else None
        if kind is None:
            self._add((*place, "do"), path, _unknown_kind(given))
            return NOTHING
        return self._of_kind(kind, given, path)

    def _of_kind(self, kind: type[Step], given: dict[str, Any], path: StepPath) -> AnyStep:
        place, is_right = step_place(path), True
        fields = {field.name: field for field in msgspec.structs.fields(kind)}
        for key in given:
            if key != "do" and key not in fields:
                unknown = because("program.step.key", nearest(key, fields), step=given["do"], key=key)
                is_right = self._add((*place, key), path, unknown)
        values: dict[str, Any] = {}
        for name, field in fields.items():
            if name in given:
                values[name] = self._field(kind, name, field.type, given[name], path)
                is_right = is_right and values[name] is not None
            elif field.required:
                is_right = self._add(place, path, _missing(given["do"], kind, name, field.type))
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
            why = error.reason if isinstance(error, _BadUnit) else None
            self._add(place, path, _of_another_kind(kind, name, expected, value, why))
            return None

    def _add(self, place: Where, path: StepPath, what: Reason) -> bool:
        """Keeps a mistake, at the line of the place or of what is around it; False."""
        line = nearest_line(self.lines, place)
        self.mistakes.append(Mistake(self.file, line, path, what))
        return False


class _BadUnit(ReasonedError):
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
        text = f"{value if value > 1 else value * 100:g}%"
        raise _BadUnit(because("program.value.percent", text=text))
    if not isinstance(value, str):
        return value
    found = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(\S+)\s*", value)
    base, factor = UNITS.get(found[2], ("", 1.0)) if found else ("", 1.0)
    if found is None or base not in unit.split(" or "):
        known = tuple(name for name, (base, _) in UNITS.items() if base in unit.split(" or "))
        raise _BadUnit(because("program.value.unit", value=_shown(value), known=known))
    return float(Decimal(found[1]) / 100) if base == "%" else float(found[1]) * factor


def _of_another_kind(kind: type[Step], name: str, expected: Any, value: object, why: Reason | None) -> Reason:
    """`why`: what is wrong with its unit."""
    word, unit, shown = _expected(kind, name, expected), _unit_of(name), _shown(value)
    if why is not None and unit:
        return because("program.value.no_unit", why, key=name, value=shown, expected=word, unit=unit)
    if why is not None:
        return because("program.value.no_share", why, key=name, value=shown, expected=word)
    if unit:
        return because("program.value.kind_and_unit", key=name, value=shown, expected=word, unit=unit)
    return because("program.value.kind", key=name, value=shown, expected=word)


def _missing(step: str, kind: type[Step], name: str, expected: Any) -> Reason:
    word, unit = _expected(kind, name, expected), _unit_of(name)
    if unit:
        return because("program.step.needs_with_unit", step=step, key=name, expected=word, unit=unit)
    return because("program.step.needs", step=step, key=name, expected=word)


def _expected(kind: type[Step], name: str, expected: Any) -> str:
    if name == "share":
        return "expected.share"
    if kind is Repeat and name == "steps":
        return "expected.steps"
    return EXPECTED.get(expected, "expected.kind")


def _unit_of(name: str) -> str:
    """Empty for a share, whose per cent is said with its kind."""
    return "" if name == "share" else MEASURED.get(name, "")


def _unknown_kind(given: Mapping[str, Any]) -> Reason:
    known = tuple(BY_KIND)
    if "do" not in given:
        return because("program.step.no_kind", known=known)
    if not isinstance(given["do"], str):
        return because("program.step.kind_of_kind", value=_shown(given["do"]), known=known)
    return because("program.step.unknown", nearest(given["do"], known), step=given["do"])


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
