"""The metadata of a recording: software versions, machine, commit and deployment."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

from gemelo.libraries.recordings.foreign import METADATA
from gemelo.libraries.recordings.mcap_file import DEPLOYMENT
from gemelo.schemas.deployment import Deployment

PACKAGES = {  # by the name in the record
    "gemelo": "gemelo", "mcap": "mcap", "zenoh": "eclipse-zenoh", "msgspec": "msgspec", "numpy": "numpy",
    "ruckig": "ruckig", "pinocchio": "pin", "coal": "coal", "ompl": "ompl", "rerun": "rerun-sdk",
}  # fmt: skip


def metadata_of(robot: str, deployment: Deployment, root: Path) -> dict[str, dict[str, str]]:
    """The records that every file begins with; passwords are in files of their own, so none is in a deployment."""
    text = msgspec.json.encode(deployment).decode()
    return {METADATA: origin(robot, root), DEPLOYMENT: {"json": text}}


def origin(robot: str, root: Path) -> dict[str, str]:
    """Versions, host and, in a git checkout at `root`, the commit."""
    said = {
        "robot": robot,
        "python": platform.python_version(),
        "system": platform.platform(),
        "processor": processor(),
        "commit": commit(root),
        **{name: version_of(package) for name, package in PACKAGES.items()},
    }
    return {key: value for key, value in said.items() if value}


def processor() -> str:
    """The model of the processor: libraries of mathematics round otherwise on another one; empty if it is not known."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


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


def version_of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
