"""Turns the shared test vectors into a C++ header: `vectors_to_header.py OUT.h device.json frames.json ...`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any


def main(out: str, *files: str) -> None:
    """Write `out` from the vector files; device.json becomes the configuration they are played against."""
    lines = ["#pragma once", '#include "vector.h"', ""]
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
    joints = ", ".join(
        f'{{"{j["name"]}", {j["lower_q8"]}, {j["upper_q8"]}, {j["max_velocity_q8"]}, '
        f"{j['max_acceleration_q8']}, {j['dir_setup_us']}, {int(j['inverted'])}}}"
        for j in device["joints"]
    )
    head = f'"{device["name"]}", {device["tick_hz"]}, {device["queue_capacity"]}, {device["state_hz"]}'
    return [
        f"inline constexpr uint32_t kVectorBoot = {device['boot_id']}u;",
        f"inline constexpr gemelo::DeviceConfig kVectorDevice = "
        f"{{{head}, {device['hold_timeout_ms']}, {len(device['joints'])}, {{{joints}}}}};",
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
