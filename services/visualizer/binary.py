"""The rerun program itself: its Python wrapper, when killed, would leave it running."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path


def rerun_binary() -> Path:
    """The path of the program in the installed package; raises RuntimeError with the remedy where there is none."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise RuntimeError("rerun is not installed: install gemelo with its extra `view`, or run `make setup`")
    folder = Path(spec.origin).parent
    for candidate in (folder / "Rerun.app/Contents/MacOS/Rerun", folder / "rerun", folder / "rerun.exe"):
        if candidate.exists():
            return candidate
    raise RuntimeError(f"{folder} holds no rerun program: reinstall the package rerun-sdk")


def environment(inherited: Mapping[str, str]) -> dict[str, str]:
    """The environment of the program: without its usage statistics, which go to a server of its maker."""
    # Rerun 0.41 has no switch of its own for one process; where CI is set it collects and sends nothing.
    return {**inherited, "CI": "1", "RUST_LOG": inherited.get("RUST_LOG", "warn")}
