"""A browser, the whole stack with the page, and the arm as a script has it."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, sync_playwright

import gemelo
from services.stack.stack import Stack
from tests.gemelo.conftest import BROKER, NEEDED, make_ready
from tests.optional import need
from tests.panel.person import Person
from tests.panel.served import Served, served_page

# As root it would put its drawing before everything else on the machine, and as a session of its own it counts as much
# as the whole stack: both are taken from it.
MODESTLY = """#!/bin/sh
echo 10 2>/dev/null >/proc/self/autogroup
exec nice -n 5 setpriv --bounding-set=-sys_nice --inh-caps=-sys_nice {program} "$@"
"""
FLAGS = [  # three dimensions are drawn by a processor; the page itself is drawn faster without what draws these
    "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-gpu-rasterization", "--disable-gpu-compositing",
]  # fmt: skip
SIZE = {"width": 900, "height": 640}  # small: the browser draws without a graphics card here


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    need("chromium")
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert program is not None
    if os.geteuid() == 0 and shutil.which("setpriv"):
        modest = tmp_path_factory.mktemp("bin") / "chromium"
        modest.write_text(MODESTLY.format(program=shlex.quote(program)))
        modest.chmod(0o755)
        program = str(modest)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def robot() -> str:
    return "rm1"


@pytest.fixture(scope="module")
def processes() -> tuple[str, ...]:
    return (*NEEDED, "panel")


@pytest.fixture(scope="module")
def twin(robot: str, processes: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    out, programs = tmp_path_factory.mktemp("out"), tmp_path_factory.mktemp("programs")
    environment = {"GEMELO_ROBOT": f"urdf/{robot}", "GEMELO_PATHS_PROGRAMS": str(programs)}
    with (
        Stack(broker=BROKER, out=out, processes=processes, environment=environment) as stack,
        pytest.MonkeyPatch.context() as patch,
    ):
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        yield stack


@pytest.fixture
def arm(twin: Stack) -> Iterator[gemelo.Arm]:
    """Referenced, armed, at rest in "home", at full speed, with an empty scene."""
    twin.wait_ready(30.0)
    with gemelo.connect(timeout=10.0) as connected:
        make_ready(connected)
        connected.move(named="home")
        yield connected


@pytest.fixture(scope="module")
def served(twin: Stack) -> Iterator[Served]:
    """The page in this process, where a file's `processes` leave it out."""
    twin.wait_ready(30.0)
    with served_page() as served:
        yield served


@pytest.fixture
def person(twin: Stack, arm: gemelo.Arm, chromium: Browser) -> Iterator[Person]:
    """Somebody who reads English, and has just opened the page."""
    with Person(chromium, twin.deployment["GEMELO_PANEL_PORT"], "en-US", SIZE) as opened:
        yield opened
        opened.require_no_errors()
