"""The arm most tests are about, the lanes, and property tests that run the same examples everywhere.

`make test` runs what is not marked `full`; `make test-all` also the rest, and every property again with
HYPOTHESIS_PROFILE=full. HYPOTHESIS_PROFILE=explore looks for new examples.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gemelo.libraries.runtime.process.arithmetic import use_one_kernel
from tests import optional, profiles

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

use_one_kernel()  # as the planner's process does: what it computes is compared with recordings of other machines

pytest_plugins = [
    "tests.cost",
    "tests.left_out",
    "tests.stacks.counts",
    "tests.stacks.groups",
    "tests.stacks.shared",
    "tests.stacks.browser",
    "pytester",
]

# A run in the background begins with Ctrl-C ignored, and every process that a test starts would inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# What the user's own twin of this folder was started with is none of the tests' business.
os.environ["GEMELO_STARTED"] = "/dev/null/started.toml"  # no file can be there

# Nor is the language of their terminal: sentences are compared in English, those of processes that tests start too.
for variable in ("GEMELO_LANG", "LC_ALL", "LC_MESSAGES", "LANG"):
    os.environ.pop(variable, None)
os.environ["LANG"] = "C.UTF-8"

profiles.load()
sys.addaudithook(optional.on_audit_event)

WHOLE = {"twin", "chromium"}  # fixtures that start a stack's processes, or a browser


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Gives each test its lane, and the tests of a file one worker, unless they share a stack with other files."""
    for item in items:
        if item.get_closest_marker("alone") or not WHOLE.isdisjoint(getattr(item, "fixturenames", ())):
            item.add_marker("full")
        if not item.get_closest_marker("xdist_group"):
            item.add_marker(pytest.mark.xdist_group(str(item.path.relative_to(item.config.rootpath))))


@pytest.fixture(scope="session")
def rm1_folder() -> Path:
    return Path(__file__).parents[1] / "urdf" / "rm1"


@pytest.fixture(scope="session")
def rm1(rm1_folder: Path) -> ArmDescription:
    from gemelo.libraries.arm.model.description import load_arm  # imports numpy, which has chosen its kernel then

    return load_arm(rm1_folder)


def pytest_collection_finish() -> None:
    """What tests and libraries are made of stays: up to a tenth of the time went into looking for garbage there."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 100)


def pytest_sessionfinish() -> None:
    """What stayed is garbage now: nanobind tells on leaving whatever of its own is still there."""
    gc.unfreeze()
