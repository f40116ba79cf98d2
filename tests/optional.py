"""Tools without which a test is skipped, named by `make test` in its closing line; in CI it fails."""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path

import pytest

OPTIONAL = Path(__file__).parents[1] / "deploy/optional"


@cache
def lack(name: str) -> str:
    """What is missing and the remedy, or nothing where `name` of deploy/optional is here."""
    done = subprocess.run([OPTIONAL, name], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout.strip()


def need(name: str) -> None:
    """Skips the test, or all that a fixture is for, where `name` is missing; CI installs it, so there it fails."""
    if not lack(name):
        return
    if "CI" in os.environ:
        pytest.fail(lack(name))
    pytest.skip(lack(name))


def need_root(file: str, with_taps: bool = False) -> None:
    """Skips all that a fixture is for where network namespaces (and TAP devices) cannot be made.

    No package brings that: `deploy/optional` names it with its own remedy, and CI that is not root goes on without.
    """
    need("ip")
    if os.geteuid() != 0:
        pytest.skip(f"network namespaces are root's to make: sudo .venv/bin/pytest {file}")
    if with_taps and not os.access("/dev/net/tun", os.W_OK):
        pytest.skip("TAP devices cannot be made here: /dev/net/tun is missing or may not be written")
