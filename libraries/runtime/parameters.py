"""Parameters: a frozen struct of scalars, declared by a node, read and set at run time."""

from __future__ import annotations

import difflib
import logging
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar, cast

import msgspec

from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.schemas.reasons import Remedy, because, plain, remedy
from gemelo.schemas.system import Empty, Parameter, Parameters, ParameterValue, SetParameter

P = TypeVar("P", bound=msgspec.Struct)

KINDS: dict[type, str] = {bool: "bool", int: "int", float: "float", str: "str"}


class ParameterSet(Generic[P]):
    """The declared parameters of a node; `value` is the present struct, replaced as a whole."""

    def __init__(self, kind: type[P], node: str) -> None:
        self._kind, self._node = kind, node
        self._declared = {field.name: _declared(field, node) for field in msgspec.structs.fields(kind)}
        self.value = kind()

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._declared)

    def listed(self) -> tuple[Parameter, ...]:
        """All parameters with their present values."""
        return tuple(self._with_value(name) for name in self._declared)

    def set(self, name: str, value: ParameterValue, strict: bool = True) -> Parameter:
        """Sets one; raises `RequestRefused` with the nearest name, type or range. Text is converted if not strict."""
        self._require(name)
        declared = self._declared[name]
        if strict and isinstance(value, bool) != (declared.type == "bool"):
            raise RequestRefused(because("parameter.type", type=str(declared.type), **self._of(name, value)))
        if isinstance(value, str) and "\0" in value:
            raise RequestRefused(because("parameter.nul", **self._of(name, value)))
        values = {each: getattr(self.value, each) for each in self._declared} | {name: value}
        try:
            changed = msgspec.convert(values, self._kind, strict=strict)
        except (msgspec.ValidationError, ValueError) as error:
            why = because("parameter.value", plain(_reason(error)), **self._of(name, value))
            raise RequestRefused(why) from error
        if declared.type == "float" and not math.isfinite(getattr(changed, name)):
            raise RequestRefused(because("parameter.not_finite", **self._of(name, value)))
        self.value = changed
        return self._with_value(name)

    def set_all(self, values: Mapping[str, ParameterValue], origin: str, strict: bool) -> None:
        """Sets those named in a file or on a command line; raises `RequestRefused` that says so."""
        for name, value in values.items():
            try:
                self.set(name, value, strict)
            except RequestRefused as error:
                raise RequestRefused(because("parameter.from", error.reason, origin=origin)) from error

    def _require(self, name: str) -> None:
        if name not in self._declared:
            hint = nearest(name, self._declared)
            raise RequestRefused(because("parameter.unknown", hint, node=self._node, name=name))

    def _of(self, name: str, value: ParameterValue) -> dict[str, str]:
        return {"node": self._node, "name": name, "value": repr(value)}

    def _with_value(self, name: str) -> Parameter:
        return msgspec.structs.replace(self._declared[name], value=getattr(self.value, name))


def _reason(error: Exception) -> str:
    """Without the path that msgspec adds: the parameter is named already."""
    return str(error).partition(" - at `$")[0]


def nearest(name: str, known: Iterable[str]) -> Remedy:
    """A hint for a name that is not known."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1)
    if near:
        return remedy("did_you_mean", name=near[0])
    return remedy("it_has", names=", ".join(names)) if names else remedy("it_has_none")


def _declared(field: msgspec.structs.FieldInfo, node: str) -> Parameter:
    described = msgspec.inspect.type_info(field.type)
    description = ""
    if isinstance(described, msgspec.inspect.Metadata):
        schema = described.extra_json_schema or {}
        description, described = schema.get("description", ""), described.type
    kind = KINDS.get(_python_type(described))
    if kind is None or field.default is msgspec.NODEFAULT:
        raise TypeError(f"{node}: parameter {field.name} must be a bool, int, float or str with a default")
    bounds = [getattr(described, name, None) for name in ("ge", "gt", "le", "lt")]
    lower, upper = (
        [float(each) for each in bounds[:2] if each is not None],
        [float(e) for e in bounds[2:] if e is not None],
    )
    default = cast("ParameterValue", field.default)
    return Parameter(
        name=field.name, type=kind, value=default, default=default, description=description,
        minimum=lower[0] if lower else None, maximum=upper[0] if upper else None,
    )  # fmt: skip


def _python_type(described: Any) -> type:
    inspect = msgspec.inspect
    kinds: dict[type, type] = {
        inspect.BoolType: bool, inspect.IntType: int, inspect.FloatType: float, inspect.StrType: str,
    }  # fmt: skip
    return kinds.get(type(described), object)


class ParameterRegistry:
    """All parameters of a node.

    The command line overrides what was saved, that the deployment file, and that the defaults.
    """

    def __init__(
        self,
        node: str,
        from_file: Mapping[str, ParameterValue],
        from_command_line: Mapping[str, ParameterValue],
        saved: SavedParameters,
        log: logging.Logger,
    ) -> None:
        self._node, self._from_file, self._from_command_line = node, from_file, from_command_line
        self._saved = saved
        self._log = log
        self._sets: list[ParameterSet[Any]] = []

    def declare(self, kind: type[P]) -> ParameterSet[P]:
        """Raises `RequestRefused` where a value given cannot be."""
        declared = ParameterSet(kind, self._node)
        declared.set_all(self._from_file, f"[parameters.{self._node}] of the deployment", strict=True)
        self._take_saved(declared)
        declared.set_all(self._from_command_line, "--set", strict=False)
        self._sets.append(declared)
        return declared

    def _take_saved(self, declared: ParameterSet[Any]) -> None:
        """All that was saved, or nothing of it where one value cannot be: the log says which, and what to do."""
        before, name = declared.value, ""
        try:
            for name, value in (values := self._saved.read()).items():
                declared.set(name, value)
        except RequestRefused as error:
            declared.value = before
            where = f"{self._saved.path}{self._saved.line(name)}: " if name else ""
            self._log.error(
                "%s%s; nothing of this file is used, the parameters are those of the deployment: mend or remove it",
                where, error,
            )  # fmt: skip
        else:
            if values:
                self._log.info("parameters of %s: %s", self._saved.path, ", ".join(values))

    def listed(self, question: Empty) -> Parameters:
        """All with their present values."""
        return Parameters(parameters=tuple(each for declared in self._sets for each in declared.listed()))

    def set(self, wanted: SetParameter, check: Callable[[Parameter], object] = lambda parameter: None) -> Parameter:
        """Raises `RequestRefused` with the nearest name, the type or the range.

        `check` is given the parameter as it would be; where it raises, nothing has changed.
        """
        for declared in self._sets:
            if wanted.name in declared.names:
                before = declared.value
                parameter = declared.set(wanted.name, wanted.value)
                if wanted.save:
                    parameter = msgspec.structs.replace(parameter, saved_in=str(self._saved.path))
                try:
                    check(parameter)
                    if wanted.save:
                        self._saved.keep(self._saved.read() | {parameter.name: parameter.value})
                except BaseException:
                    declared.value = before  # what was asked for was all of it
                    raise
                kept = f", saved in {parameter.saved_in}" if parameter.saved_in else ""
                self._log.info("parameter %s = %r%s", parameter.name, parameter.value, kept)
                return parameter
        known = [name for declared in self._sets for name in declared.names]
        raise RequestRefused(
            because("parameter.unknown", nearest(wanted.name, known), node=self._node, name=wanted.name)
        )
