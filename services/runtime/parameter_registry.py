"""All parameters of one node: where their first values come from, and the requests that list and set them."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from schemas.system import Empty, Parameter, Parameters, ParameterValue, SetParameter
from schemas.topics import Request
from services.runtime.errors import Refused
from services.runtime.parameters import ParameterSet, nearest

P = TypeVar("P", bound=msgspec.Struct)


class ParameterRegistry:
    """What a node has declared; the command line wins over the deployment file, and that over the defaults."""

    def __init__(
        self,
        node: str,
        from_file: Mapping[str, ParameterValue],
        from_command_line: Mapping[str, ParameterValue],
        log: logging.Logger,
    ) -> None:
        self._node, self._from_file, self._from_command_line = node, from_file, from_command_line
        self._log = log
        self._sets: list[ParameterSet[Any]] = []
        keys = f"@node/{node}/parameters"
        self.list_request = Request(f"{keys}/list", Empty, Parameters, node, "all parameters of the node")
        self.set_request = Request(f"{keys}/set", SetParameter, Parameter, node, "a new value for one of them")

    def declare(self, kind: type[P]) -> ParameterSet[P]:
        """Raises `Refused` where a value given cannot be."""
        declared = ParameterSet(kind, self._node)
        declared.set_all(self._from_file, f"[parameters.{self._node}] of the deployment", strict=True)
        declared.set_all(self._from_command_line, "--set", strict=False)
        self._sets.append(declared)
        return declared

    def listed(self, question: Empty) -> Parameters:
        """All with their present values."""
        return Parameters(parameters=tuple(each for declared in self._sets for each in declared.listed()))

    def set(self, wanted: SetParameter) -> Parameter:
        """Raises `Refused` with the nearest name, the type or the range."""
        for declared in self._sets:
            if wanted.name in declared.names:
                parameter = declared.set(wanted.name, wanted.value)
                self._log.info("parameter %s = %r", parameter.name, parameter.value)
                return parameter
        known = [name for declared in self._sets for name in declared.names]
        raise Refused(f'{self._node} has no parameter "{wanted.name}": {nearest(wanted.name, known)}')
