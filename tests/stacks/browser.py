"""The one browser of a session; each person at a page has a context of their own."""

from __future__ import annotations

import os
import shlex
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from tests.optional import need
from tests.stacks.counts import count_start

if TYPE_CHECKING:  # it is slow to load, and few tests need it
    from playwright.sync_api import Browser, BrowserContext, ViewportSize

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
SIZE: ViewportSize = {"width": 900, "height": 640}  # small: the browser draws without a graphics card here


PATIENCE = 120_000.0  # [ms] for whatever a page is asked: a loaded machine draws a picture in seconds


def new_context(browser: Browser, **options: Any) -> BrowserContext:
    """A context, with these options of playwright, whose pages are waited for with patience."""
    context = browser.new_context(**options)
    context.set_default_timeout(PATIENCE)
    return context


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    need("chromium")
    from playwright.sync_api import expect, sync_playwright

    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert program is not None
    if os.geteuid() == 0 and shutil.which("setpriv"):
        modest = tmp_path_factory.mktemp("bin") / "chromium"
        modest.write_text(MODESTLY.format(program=shlex.quote(program)))
        modest.chmod(0o755)
        program = str(modest)
    expect.set_options(timeout=PATIENCE)
    with sync_playwright() as playwright:
        count_start("browsers")
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()
