"""A tiny ONNX model, written byte by byte: it finds the one red thing of an image, in a layout of YOLO.

The protobuf messages are those of onnx.proto (ModelProto, GraphProto, NodeProto, TensorProto ...), by field number.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

FLOAT, INT64 = 1, 7
BOXES = 100  # of which all but the first are empty


def varint(value: int) -> bytes:
    found = b""
    value &= 2**64 - 1
    while value > 127:
        found += bytes([value & 127 | 128])
        value >>= 7
    return found + bytes([value])


def field(number: int, value: int | bytes | str | float) -> bytes:
    if isinstance(value, float):
        return varint(number << 3 | 5) + struct.pack("<f", value)
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tensor(name: str, values: np.ndarray) -> bytes:
    kind = INT64 if values.dtype == np.int64 else FLOAT
    dims = b"".join(field(1, size) for size in values.shape)
    return dims + field(2, kind) + field(8, name) + field(9, values.tobytes())


def attribute(name: str, value: int | list[int]) -> bytes:
    if isinstance(value, int):
        return field(1, name) + field(3, value) + field(20, 2)
    return field(1, name) + b"".join(field(8, each) for each in value) + field(20, 7)


def node(kind: str, inputs: list[str], output: str, **attributes: int | list[int]) -> bytes:
    said = b"".join(field(1, each) for each in inputs) + field(2, output) + field(3, output) + field(4, kind)
    return said + b"".join(field(5, attribute(name, value)) for name, value in attributes.items())


def value_info(name: str, shape: tuple[int, ...]) -> bytes:
    """A size of 0 is left open, under a name."""
    dims = b"".join(field(1, field(1, size) if size else field(2, "open")) for size in shape)
    return field(1, name) + field(2, field(1, field(1, FLOAT) + field(2, dims)))


def red_finder(
    path: Path, size: int, layout: str = "v8", names: str = "", said: tuple[int, ...] = (), gain: float = 0.01
) -> Path:
    """Writes a model for images of `size` x `size` pixels: centre and extent of what is red, by its moments.

    `names` is what it says of its classes, `said` the sizes that it says its images have; with a negative `gain` its
    scores are negative.
    """
    grid = np.arange(size, dtype=np.float32)
    constants = {
        "redness": np.array([1.0, -0.5, -0.5], np.float32).reshape(1, 3, 1, 1),
        "bias": np.array([-0.25], np.float32),
        "x": np.broadcast_to(grid, (1, 1, size, size)).copy(),
        "y": np.broadcast_to(grid[:, None], (1, 1, size, size)).copy(),
        "little": np.full((1, 1, 1, 1), 1e-6, np.float32),
        "twelve": np.full((1, 1, 1, 1), 12.0, np.float32),
        "hundredth": np.full((1, 1, 1, 1), gain, np.float32),
        "flat": np.array([1, 5, 1], np.int64),
        "nothing": np.zeros((1, 5, BOXES - 1), np.float32),
    }
    total = {"axes": [2, 3], "keepdims": 1}
    nodes = [
        node("Conv", ["image", "redness", "bias"], "raw", kernel_shape=[1, 1]),
        node("Relu", ["raw"], "red"),
        node("ReduceSum", ["red"], "sum", **total), node("Add", ["sum", "little"], "mass"),
    ]  # fmt: skip
    for axis in ("x", "y"):
        nodes += [
            node("Mul", ["red", axis], f"{axis}1"), node("ReduceSum", [f"{axis}1"], f"{axis}2", **total),
            node("Div", [f"{axis}2", "mass"], f"{axis}_middle"),
            node("Sub", [axis, f"{axis}_middle"], f"{axis}_away"),
            node("Mul", [f"{axis}_away", f"{axis}_away"], f"{axis}3"), node("Mul", [f"{axis}3", "red"], f"{axis}4"),
            node("ReduceSum", [f"{axis}4"], f"{axis}5", **total), node("Div", [f"{axis}5", "mass"], f"{axis}6"),
            node("Mul", [f"{axis}6", "twelve"], f"{axis}7"), node("Sqrt", [f"{axis}7"], f"{axis}_wide"),
        ]  # fmt: skip
    nodes += [
        node("Mul", ["mass", "hundredth"], "more"),
        node("Tanh", ["more"], "score"),
        node("Concat", ["x_middle", "y_middle", "x_wide", "y_wide", "score"], "row", axis=1),
        node("Reshape", ["row", "flat"], "box"),
        node("Concat", ["box", "nothing"], "said" if layout == "v8" else "turned", axis=2),
    ]
    if layout == "turned":
        nodes.append(node("Transpose", ["turned"], "said", perm=[0, 2, 1]))
    shape = (1, 5, BOXES) if layout == "v8" else (1, BOXES, 5)
    graph = b"".join(field(1, each) for each in nodes) + field(2, "red")
    graph += b"".join(field(5, tensor(name, values)) for name, values in constants.items())
    graph += field(11, value_info("image", said or (1, 3, size, size))) + field(12, value_info("said", shape))
    metadata = field(14, field(1, "task") + field(2, "detect")) + field(14, field(1, "names") + field(2, names))
    path.write_bytes(field(1, 7) + field(8, field(1, "") + field(2, 11)) + field(7, graph) + metadata)
    return path
