"""The metadata of a recording: software versions, machine and commit."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def origin(robot: str, root: Path) -> dict[str, str]:
    """Versions, host and, in a git checkout at `root`, the commit."""
    said = {
        "robot": robot,
        "gemelo": _version("gemelo"),
        "python": platform.python_version(),
        "mcap": _version("mcap"),
        "zenoh": _version("eclipse-zenoh"),
        "system": platform.platform(),
        "commit": commit(root),
    }
    return {key: value for key, value in said.items() if value}


def commit(root: Path) -> str:
    """The commit that is checked out at `root`, read without git; empty where that is not known."""
    git = root / ".git"
    try:
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        reference = head.removeprefix("ref: ")
        loose = git / reference
        return loose.read_text().strip() if loose.exists() else _packed(git, reference)
    except OSError:
        return ""


def _packed(git: Path, reference: str) -> str:
    lines = (git / "packed-refs").read_text().splitlines()
    return next((line.split()[0] for line in lines if line.endswith(f" {reference}")), "")


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
