"""Optional tools of the tests: named in one line, skipped on a person's machine, failing in CI."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from tests import optional

ROOT = project_root()


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """A PATH on which nothing optional is."""
    for name in ("sh", "cut", "sed", "grep", "ls", "dirname", "cat"):
        found = shutil.which(name)
        assert found is not None
        (tmp_path / name).symlink_to(found)
    return tmp_path


def said(path: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([ROOT / "deploy/optional", *words], env={"PATH": str(path)}, capture_output=True, text=True)


def test_what_is_missing_is_named_in_one_line_with_the_command_that_installs_all_of_it(bare: Path):
    told = said(bare)
    assert told.returncode == 0
    assert len(told.stdout.splitlines()) == 1
    assert "the RISC-V compiler, QEMU" in told.stdout
    command = told.stdout.partition("sudo apt-get install ")[2].split()
    assert command == said(bare, "packages").stdout.split()
    assert {"gcc-riscv64-unknown-elf", "qemu-system-misc", "git"} <= set(command)


def test_one_thing_that_is_missing_is_said_with_its_remedy(bare: Path):
    told = said(bare, "git")
    assert (told.returncode, told.stdout) == (1, "git missing: sudo apt-get install git\n")


def test_where_all_is_here_nothing_is_said(bare: Path):
    for name in ("git", "riscv64-unknown-elf-g++", "qemu-system-riscv32", "mosquitto"):
        (bare / name).symlink_to(shutil.which("true") or "/bin/true")
    assert said(bare, "git").returncode == 0
    assert not {"git", "mosquitto", "qemu-system-misc"} & set(said(bare, "packages").stdout.split())


@pytest.mark.parametrize(("user", "is_named"), [(1000, True), (0, False)])
def test_what_only_root_can_run_is_in_the_same_line(bare: Path, user: int, is_named: bool):
    (bare / "id").write_text(f"#!/bin/sh\necho {user}\n")
    (bare / "id").chmod(0o755)
    told = said(bare).stdout
    assert len(told.splitlines()) == 1
    assert ("sudo .venv/bin/pytest tests/stack tests/runtime/test_dead_links.py" in told) is is_named
    assert told.partition("sudo apt-get install ")[2].split() == said(bare, "packages").stdout.split()


@pytest.mark.parametrize(
    ("environment", "outcome"), [({}, pytest.skip.Exception), ({"CI": "true"}, pytest.fail.Exception)]
)
def test_a_test_that_needs_it_is_skipped_and_fails_in_ci(monkeypatch, environment, outcome):
    monkeypatch.setattr(os, "environ", environment)
    monkeypatch.setattr(optional, "lack", lambda name: f"{name} missing: sudo apt-get install {name}")
    with pytest.raises(outcome, match="mosquitto missing: sudo apt-get install mosquitto"):
        optional.need("mosquitto")


@pytest.mark.parametrize(
    ("environment", "outcome"), [({}, pytest.skip.Exception), ({"CI": "true"}, pytest.fail.Exception)]
)
def test_who_is_not_root_goes_without_network_namespaces_but_ci_does_not(monkeypatch, environment, outcome):
    monkeypatch.setattr(os, "environ", environment)
    monkeypatch.setattr(optional, "lack", lambda name: "")
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(outcome, match=r"root's to make: sudo \.venv/bin/pytest tests/stack/test_hosts\.py"):
        optional.need_root("tests/stack/test_hosts.py")


def test_that_there_are_no_tap_devices_is_said_in_the_same_line(bare: Path):
    command, environment = [ROOT / "deploy/optional"], {"PATH": str(bare), "TUN": str(bare / "none")}
    told = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert len(told.splitlines()) == 1
    assert "which need TAP devices (sudo modprobe tun)" in told


def test_a_name_that_is_in_no_row_is_an_error(bare: Path):
    assert said(bare, "gtest").returncode == 2
