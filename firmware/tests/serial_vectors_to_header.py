"""Turns the shared vectors of the serial line into a C++ header: `serial_vectors_to_header.py OUT.h FOLDER`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any


def main(out: str, folder: str) -> None:
    """Write `out` from packets.json, lines.json and configs.json."""
    packets, lines, configs = (read(Path(folder) / name) for name in ("packets.json", "lines.json", "configs.json"))
    text = [
        "#pragma once",
        '#include "serial_vector.h"',
        table("PacketVector", "kPackets", (packet(case) for case in packets)),
        f"inline const std::string kTextConfig = {quoted(json.dumps(lines['config']))};",
        table("LineVector", "kLines", (line(case) for case in lines["cases"])),
        table("ConfigVector", "kConfigs", (config(case) for case in configs)),
        "",
    ]
    Path(out).write_text("\n".join(text), encoding="utf-8")


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def table(kind: str, name: str, rows: Iterable[str]) -> str:
    return f"inline const std::vector<{kind}> {name} = {{\n" + "".join(f"    {{{row}}},\n" for row in rows) + "};"


def packet(case: dict[str, Any]) -> str:
    return f"{quoted(case['name'])}, {quoted(case['sent'])}, {listed(case['frames'])}, {case['bad']}"


def line(case: dict[str, Any]) -> str:
    counts = f"{case['lost']}, {case['late']}"
    return f"{quoted(case['name'])}, {listed(case['lines'])}, {listed(case['answers'])}, {counts}"


def config(case: dict[str, Any]) -> str:
    return ", ".join(quoted(case[key]) for key in ("name", "text", "part", "reason"))


def quoted(text: str) -> str:
    return json.dumps(text)  # of ASCII, a JSON text is a C++ one too


def listed(texts: list[str]) -> str:
    return "{" + ", ".join(quoted(text) for text in texts) + "}"


if __name__ == "__main__":
    main(*sys.argv[1:])
