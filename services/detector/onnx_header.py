"""Reader of an ONNX file's header: the size of the images that the model takes, and the names of its classes.

A file is one message of protobuf; the numbers of the fields are those of onnx.proto. Nothing is copied of the weights.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

GRAPH, METADATA = 7, 14  # of ModelProto
INITIALIZER, INPUT = 5, 11  # of GraphProto
TENSOR_NAME = 8  # of TensorProto
NAME, TYPE, TENSOR_TYPE, SHAPE, DIMENSION, VALUE = 1, 2, 1, 2, 1, 1  # of ValueInfoProto, down to its dimensions
ENTRY_KEY, ENTRY_VALUE = 1, 2  # of StringStringEntryProto
EMPTY = memoryview(b"")
NAMES = "names"  # the entry in which YOLO writes its classes, as a Python dict
VARINT, BYTES = 0, 2  # how a field is written: a number, or so many bytes
Field = tuple[int, int, memoryview]  # its number, how it is written, and what it holds


class NotOnnx(ReasonedError, ValueError):
    """A file that is no such message."""


@dataclass(frozen=True)
class Header:
    """Of one model."""

    sizes: tuple[int, ...]  # (batch, channels, height, width) of its first input; 0 for what is left open
    names: dict[int, str] = field(default_factory=dict)  # of its classes by number; empty where it does not say them


def read_header(path: Path) -> Header:
    """Raises `NotOnnx` and `OSError`."""
    sizes: tuple[int, ...] = ()
    names: dict[int, str] = {}
    for number, _, content in _fields(memoryview(path.read_bytes())):
        if number == GRAPH:
            sizes = _input_sizes(content)
        elif number == METADATA and _text(_of(content, ENTRY_KEY)) == NAMES:
            names = _class_names(_text(_of(content, ENTRY_VALUE)))
    if not sizes:
        raise NotOnnx(because("model.onnx.no_input"))
    return Header(sizes, names)


def _input_sizes(graph: memoryview) -> tuple[int, ...]:
    """Of the first input that is no constant: older exports list these among the inputs as well."""
    constants, inputs = set(), []
    for number, _, content in _fields(graph):
        if number == INITIALIZER:
            constants.add(bytes(_of(content, TENSOR_NAME)))
        elif number == INPUT:
            inputs.append(content)
    for each in inputs:
        if bytes(_of(each, NAME)) not in constants:
            shape = _of(_of(_of(each, TYPE), TENSOR_TYPE), SHAPE)
            return tuple(_value(content) for number, _, content in _fields(shape) if number == DIMENSION)
    return ()


def _value(dimension: memoryview) -> int:
    """0 where it has a name, or nothing, in place of a number."""
    for number, how, content in _fields(dimension):
        if number == VALUE and how == VARINT:
            return _number(content, 0)[0]
    return 0


def _class_names(text: str) -> dict[int, str]:
    """Of "{0: 'cup', 1: 'mug'}"; nothing of any other text."""
    try:
        said = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return {}
    if isinstance(said, list):
        said = dict(enumerate(said))
    if not isinstance(said, dict) or not all(isinstance(key, int) and key >= 0 for key in said):
        return {}
    return {key: str(value) for key, value in said.items()}


def _of(message: memoryview, wanted: int) -> memoryview:
    """What the first field of that number holds; nothing where there is none."""
    return next((content for number, how, content in _fields(message) if number == wanted and how == BYTES), EMPTY)


def _text(content: memoryview) -> str:
    return bytes(content).decode("utf-8", "replace")


def _fields(message: memoryview) -> Iterator[Field]:
    """In the order of the message; raises `NotOnnx` where it is none."""
    at = 0
    while at < len(message):
        key, start = _number(message, at)
        match key & 7:
            case 0:
                _, at = _number(message, start)
            case 1:
                at = start + 8
            case 2:
                length, start = _number(message, start)
                at = start + length
            case 5:
                at = start + 4
            case how:
                raise NotOnnx(because("model.onnx.field", way=how))
        if at > len(message):
            raise NotOnnx(because("model.onnx.cut.field"))
        yield key >> 3, key & 7, message[start:at]


def _number(message: memoryview, at: int) -> tuple[int, int]:
    """A number in seven bits of each byte, the lowest first, and where it ends."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise NotOnnx(because("model.onnx.cut.number"))
        byte = message[at]
        value, at = value | (byte & 127) << shift, at + 1
        if byte < 128:
            return value, at
    raise NotOnnx(because("model.onnx.long"))
