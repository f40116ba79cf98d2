"""`gemelo collision`: the shapes and spheres of a robot's links, and the pairs of links that need no check."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from services.cli.columns import table
from services.cli.exits import CommandError, ExitCode, usage

if TYPE_CHECKING:
    from services.arm.collision_matrix import Verdict

FIT = "services.collision_fitting.main"  # in a process of its own: the command line loads no planner


def spheres(folder: Path, bulge: float) -> ExitCode:
    """Prints a line for each link; `bulge` [mm] is how far a sphere may reach beyond it."""
    return _fitted(folder, "--bulge", f"{bulge:g}")


def shapes(folder: Path, most: int, links: Sequence[str], write: bool) -> ExitCode:
    """Prints what fits the links' meshes, with at most so many shapes each; writes it into the URDF with `write`."""
    only = [f"--link={link}" for link in links]
    return _fitted(folder, "--meshes", f"--most={most}", *only, *(["--write"] if write else []))


def _fitted(folder: Path, *options: str) -> ExitCode:
    ended = subprocess.run([sys.executable, "-m", FIT, *options, "--", str(folder)], check=False)
    return ExitCode.OK if ended.returncode == 0 else ExitCode.FAILED


def matrix(folder: Path, write: bool) -> ExitCode:
    """Prints what sampling finds and what that changes in the SRDF; changes it with `write`."""
    from services.arm.collision_matrix import collision_matrix
    from services.arm.description import load_arm
    from services.arm.srdf_edit import with_pairs

    try:
        arm = load_arm(folder)
        text = arm.srdf_path.read_text(encoding="utf-8")
    except (ValueError, OSError) as error:
        raise usage(str(error)) from error
    verdicts = collision_matrix(arm)
    wanted, lines = plan_of(text, verdicts)
    print(listing(verdicts))
    changed = with_pairs(text, wanted)
    print("\n".join(lines) if lines else f"{arm.srdf_path} says the same: nothing to change")
    if lines and write:
        _write(arm.srdf_path, changed)
    elif lines:
        print("nothing is written: give --write for that")
    return ExitCode.OK


def plan_of(text: str, verdicts: list[Verdict]) -> tuple[dict[tuple[str, str], str], list[str]]:
    """The pairs that the SRDF is to have with their reasons, and each change in words; a person's reasons stay."""
    from services.arm.collision_matrix import Reason
    from services.arm.srdf_edit import entries

    present = {entry.pair: entry.reason for entry in entries(text)}
    ours = {str(reason) for reason in Reason}
    found = {frozenset(verdict.pair): verdict for verdict in verdicts}
    wanted: dict[tuple[str, str], str] = {}
    lines = []
    for pair, reason in present.items():
        if reason not in ours:
            first, *rest = sorted(pair)
            wanted[(first, rest[0] if rest else first)] = reason
        elif pair not in found or found[pair].reason is None:
            lines.append(f"remove {' and '.join(sorted(pair))} ({reason}): {_why(found.get(pair))}")
    for pair, verdict in found.items():
        if verdict.reason is not None and present.get(pair, "") in (*ours, ""):
            wanted[verdict.pair] = verdict.reason
            if present.get(pair) != verdict.reason:
                was = f", was {present[pair]}" if pair in present else ""
                lines.append(f"add {' and '.join(verdict.pair)} ({verdict.reason}{was})")
    return wanted, lines


def _why(verdict: Verdict | None) -> str:
    if verdict is None:
        return "one of them has no collision shape"
    return f"they come as near as {1000.0 * verdict.nearest:.1f} mm"


def listing(verdicts: list[Verdict]) -> str:
    """A table of all pairs."""
    rows = [
        (
            *verdict.pair,
            verdict.reason or "checked",
            *(f"{1000.0 * d:.1f}" for d in (verdict.nearest, verdict.farthest)),
        )
        for verdict in verdicts
    ]
    return table(("link", "and link", "is", "nearest [mm]", "farthest [mm]"), rows)


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}") from error
    print(f"{path} is changed; `gemelo check {path.parent}` looks at it as a whole")
