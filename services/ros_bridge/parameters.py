"""The six services of rcl_interfaces with which `ros2 param` lists, gets and dumps parameters; none can be set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np

from gemelo.libraries.ros2.types import BadRosMessage, decode, encode, make, ros_type
from gemelo.libraries.runtime.endpoints import parameters_request
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.ros_node import RosQuery
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.system import Empty, ParameterValue
from gemelo.schemas.topics import GATEWAY, PLANNER
from gemelo.services.ros_bridge.triggers import Serving

Value = ParameterValue | tuple[str, ...]
Answer = Callable[[Any], dict[str, Any]]  # of the decoded request; the fields of the response
FIELDS = {
    "bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": "",
    "byte_array_value": np.array([], np.uint8),
    "bool_array_value": np.array([], bool), "integer_array_value": np.array([], np.int64),
    "double_array_value": np.array([], np.float64), "string_array_value": [],
}  # fmt: skip
NOT_SET, BOOL, INTEGER, DOUBLE, STRING, STRINGS = 0, 1, 2, 3, 4, 9  # of rcl_interfaces/ParameterType
OF = "rcl_interfaces/srv"
PERIOD = 5.0  # [s] after which what another node has is asked for again
TO_ANSWER = 1.0  # [s]


class RosParameters:
    """The parameters that the node shows: its own, and those of gateway and planner behind their names."""

    def __init__(self, node: Node, ros: Serving, own: Mapping[str, Value]) -> None:
        self._node, self._own = node, dict(own)
        self._of: dict[str, dict[str, Value]] = {GATEWAY: {}, PLANNER: {}}
        answers: dict[str, Answer] = {
            "ListParameters": self.list_parameters,
            "GetParameters": self.get_parameters,
            "GetParameterTypes": self.get_parameter_types,
            "DescribeParameters": self.describe_parameters,
            "SetParameters": self.set_parameters,
            "SetParametersAtomically": self.set_parameters_atomically,
        }
        for name, answer in answers.items():
            ros.serve(f"~/{answer.__name__}", ros_type(f"{OF}/{name}"), partial(_reply, f"{OF}/{name}", answer))
        node.every(PERIOD, self._ask)
        self._ask()

    @property
    def values(self) -> dict[str, Value]:
        """By name."""
        others = {f"{node}.{name}": each for node, found in self._of.items() for name, each in found.items()}
        return self._own | others

    def list_parameters(self, request: Any) -> dict[str, Any]:
        """Of the names that begin with one of the prefixes, at most `depth` words deep."""
        found, prefixes = self.values, tuple(request.prefixes)
        names = [name for name in found if not prefixes or _is_below(name, prefixes, int(request.depth))]
        if not prefixes and request.depth:
            names = [name for name in names if name.count(".") < request.depth]
        parents = sorted({name.rpartition(".")[0] for name in names if "." in name})
        return {"result": make("rcl_interfaces/msg/ListParametersResult", names=names, prefixes=parents)}

    def get_parameters(self, request: Any) -> dict[str, Any]:
        """The values of those that there are; of another one, that it is not set."""
        found = self.values
        return {"values": [value_of(found.get(name)) for name in request.names]}

    def get_parameter_types(self, request: Any) -> dict[str, Any]:
        found = self.values
        return {"types": np.array([type_of(found.get(name)) for name in request.names], np.uint8)}

    def describe_parameters(self, request: Any) -> dict[str, Any]:
        """Each is read-only here."""
        found = self.values
        descriptors = [
            make(
                "rcl_interfaces/msg/ParameterDescriptor",
                name=name, type=type_of(found.get(name)), description="", additional_constraints="", read_only=True,
                dynamic_typing=False, floating_point_range=[], integer_range=[],
            )
            for name in request.names
        ]  # fmt: skip
        return {"descriptors": descriptors}

    def set_parameters(self, request: Any) -> dict[str, Any]:
        """None is set."""
        return {"results": [_refused(each.name) for each in request.parameters]}

    def set_parameters_atomically(self, request: Any) -> dict[str, Any]:
        """None is set."""
        return {"result": _refused(request.parameters[0].name if request.parameters else "")}

    def _ask(self) -> None:
        for name in self._of:
            self._ask_of(name)

    def _ask_of(self, name: str) -> None:
        def take() -> None:
            try:
                found = pending.response().parameters
            except (RequestRefused, NoAnswer):
                return
            self._of[name] = {each.name: each.value for each in found}

        pending = self._node.ask_at_once(parameters_request(name), Empty(), TO_ANSWER, lambda: self._node.post(take))


def _reply(kind: str, answer: Answer, query: RosQuery) -> None:
    try:
        request = decode(f"{kind}_Request", query.payload)
    except BadRosMessage:
        query.drop()
    else:
        query.reply(encode(make(f"{kind}_Response", **answer(request))))


def _is_below(name: str, prefixes: Iterable[str], depth: int) -> bool:
    """True for a name that is a prefix or below one, at most `depth` words; 0: however many."""
    below = [name.removeprefix(each + ".") for each in prefixes if name.startswith(each + ".")]
    return name in prefixes or any(not depth or each.count(".") < depth for each in below)


def type_of(value: Value | None) -> int:
    """The number of rcl_interfaces/ParameterType."""
    match value:
        case bool():
            return BOOL
        case int():
            return INTEGER
        case float():
            return DOUBLE
        case str():
            return STRING
        case tuple():
            return STRINGS
    return NOT_SET


def value_of(value: Value | None) -> Any:
    """rcl_interfaces/ParameterValue."""
    field = {BOOL: "bool_value", INTEGER: "integer_value", DOUBLE: "double_value", STRING: "string_value",
             STRINGS: "string_array_value"}.get(type_of(value))  # fmt: skip
    own = {field: list(value) if isinstance(value, tuple) else value} if field else {}
    return make("rcl_interfaces/msg/ParameterValue", type=type_of(value), **(FIELDS | own))


def _refused(name: str) -> Any:
    why = because("ros.parameter.read_only", remedy("ros_set_parameter"), name=name)
    return make("rcl_interfaces/msg/SetParametersResult", successful=False, reason=str(why))
