"""Turns the shared test vectors into a C++ header: `vectors_to_header.py OUT.h device.json frames.json ...`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any


def main(out: str, *files: str) -> None:
    """Write `out` from the vector files; device.json becomes the configuration they are played against."""
    lines = ["#pragma once", "#include <string>", '#include "vector.h"', ""]
    vectors: list[dict[str, Any]] = []
    for file in sorted(files):
        content = json.loads(Path(file).read_text(encoding="utf-8"))
        if Path(file).name == "device.json":
            lines += device_lines(content)
        else:
            vectors += content
    lines += ["inline const std::vector<Vector> kVectors = {", *map(vector_line, vectors), "};", ""]
    Path(out).write_text("\n".join(lines), encoding="utf-8")


def device_lines(device: dict[str, Any]) -> list[str]:
    text = json.dumps(device["config"], separators=(",", ":"))
    return [
        f"inline constexpr uint32_t kVectorBoot = {device['boot_id']}u;",
        f'inline const std::string kVectorConfig = R"({text})";',
        "",
    ]


def vector_line(vector: dict[str, Any]) -> str:
    data = ", ".join(f"0x{byte:02x}" for byte in bytes.fromhex(vector["frame"]))
    expected = vector["expected"]
    answer = f'"{expected["answer"]}"' if expected["answer"] else "nullptr"
    numbers = ", ".join(str(expected.get(key, 0)) for key in ("code", "joint", "knot", "value", "limit"))
    retained = "true" if vector.get("retained") else "false"
    return f'    Vector{{"{vector["name"]}", {{{data}}}, {retained}, {answer}, {numbers}}},'


if __name__ == "__main__":
    main(*sys.argv[1:])
