"""Tools without which a test is skipped, named by `make test` in its closing line; in CI it fails.

A test that starts one of their programs in its own process needs it without a word; what a process of the product
starts, it names with `need`.
"""

from __future__ import annotations

import os
import subprocess
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import pytest

OPTIONAL = Path(__file__).parents[1] / "deploy/optional"
PATH = os.environ.get("PATH", os.defpath)  # not that of a test which has made another for itself


@cache
def lack(name: str) -> str:
    """What is missing and the remedy, or nothing where `name` of deploy/optional is here."""
    done = _ask(name)
    assert done.returncode in (0, 1), done.stderr
    return done.stdout.strip()


def _ask(word: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [OPTIONAL, word], capture_output=True, text=True, env={**os.environ, "PATH": PATH}, check=False
    )


@cache
def programs() -> dict[str, str]:
    """The row of deploy/optional that each program belongs to."""
    rows = (line.split("|") for line in _ask("programs").stdout.splitlines())
    return {program: name for name, several in rows for program in several.split()}


def on_audit_event(event: str, arguments: tuple[Any, ...]) -> None:
    """Asks for the program that is about to be started by its name, as sys.addaudithook calls it."""
    if event == "subprocess.Popen" and isinstance(command := arguments[1], list | tuple):
        first = command[0] if command else ""
        if isinstance(first, str) and "/" not in first and first in programs():
            need(programs()[first])


def need(name: str) -> None:
    """Skips the test, or all that a fixture is for, where `name` is missing; CI installs it, so there it fails."""
    if lack(name):
        _go_without(lack(name))


def need_site() -> None:
    """Skips all that a fixture is for where the packages of the site have not been installed; .ci/run does, so there it
    fails."""
    if not (OPTIONAL.parents[1] / ".gemelo/docs/bin/mkdocs").exists():
        _go_without("the packages of the site are missing: make docs")


def need_root(file: str, with_taps: bool = False) -> None:
    """Skips all that a fixture is for where network namespaces (and TAP devices) cannot be made.

    No package brings that right: `deploy/optional` names both in the closing line of `make test`, each with its remedy.
    CI runs as root, so there it fails; whether its kernel has TAP devices is not the project's to say.
    """
    need("ip")
    if os.geteuid() != 0:
        _go_without(f"network namespaces are root's to make: sudo .venv/bin/pytest {file}")
    if with_taps and not os.access("/dev/net/tun", os.W_OK):
        pytest.skip(
            "TAP devices cannot be made here: /dev/net/tun is missing or may not be written (sudo modprobe tun)"
        )


def need_mounts() -> None:
    """Skips the test where no disk can be mounted: as `need_root`, CI runs as root, so there it fails."""
    if os.geteuid() != 0:
        _go_without("disks that fill up are root's to mount: sudo .venv/bin/pytest, with the file's name")


def _go_without(reason: str) -> NoReturn:
    """What a person's machine lacks is left out of their run, and said; what CI lacks would never be tested at all."""
    if "CI" in os.environ:
        pytest.fail(reason)
    pytest.skip(reason)
