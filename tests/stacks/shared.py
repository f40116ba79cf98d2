"""The whole stacks that tests share: one of each kind a session, at most one at a time in a worker."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

import gemelo
from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.stack.stack import PROCESSES, Stack
from tests.optional import need
from tests.stacks.reset import Reset

NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")
BROKER = "mosquitto" if shutil.which("mosquitto", path="/usr/bin:/usr/sbin:/usr/local/sbin") else "embedded"


class Kind(NamedTuple):
    """What one shared stack runs."""

    robot: str
    processes: tuple[str, ...]
    broker: str = BROKER
    has_cell: bool = False  # its sample cell, whose camera draws a quarter as much: a browser draws beside it


KINDS = {
    "rm1_stack": Kind(
        "rm1", tuple(n for n in PROCESSES if n not in ("viewer", "panel", "camera", "detector")), "mosquitto"
    ),
    "panel_stack": Kind("rm1", (*NEEDED, "panel")),
    "cell_stack": Kind("rm1", (*NEEDED, "logger", "camera", "detector", "panel"), has_cell=True),
    "parol6_stack": Kind("parol6", (*NEEDED, "panel")),
}


class SharedStacks:
    """Starts a stack when the first test asks for its kind, and ends it when one asks for another kind."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kind = ""
        self._stack: Stack | None = None
        self._reset: Reset | None = None
        self._started = 0

    def lend(self, name: str) -> Stack:
        """The running stack of that kind, as it was after its start."""
        if name != self._kind or self._stack is None:
            self.stop()
            self._kind, self._stack = name, self._start(name)
        return self._stack

    def reset(self, name: str) -> Reset:
        """What leads that kind's stack back to how it was."""
        stack = self.lend(name)
        if self._reset is None:
            self._reset = Reset(stack)
        return self._reset

    def restart(self) -> None:
        """Starts what runs anew, on the same ports."""
        self._forget_reset()
        if self._stack is not None:
            self._stack.stop()
            self._stack.start()

    def stop(self) -> None:
        """Ends what runs."""
        self._forget_reset()
        stack, self._stack = self._stack, None
        if stack is not None:
            stack.stop()

    def _forget_reset(self) -> None:
        reset, self._reset = self._reset, None
        if reset is not None:
            reset.close()

    def _start(self, name: str) -> Stack:
        kind = KINDS[name]
        if kind.broker == "mosquitto":
            need("mosquitto")
        self._started += 1
        folder = self._folder / f"{name}_{self._started}"
        folder.mkdir()
        environment = {
            "GEMELO_ROBOT": f"urdf/{kind.robot}",
            "GEMELO_PATHS_PROGRAMS": str(folder / "programs"),
        }
        (folder / "programs").mkdir()
        if kind.has_cell:
            environment["GEMELO_CELL"] = str(quick_cell(kind.robot, folder / "cell.toml"))
        stack = Stack(broker=kind.broker, out=folder / "out", processes=kind.processes, environment=environment)
        return stack.__enter__()


def quick_cell(robot: str, file: Path) -> Path:
    """The sample cell of that arm, as `file`, with 4 images a second of one ray a pixel."""
    sample = (project_root() / f"urdf/{robot}/cell.toml").read_text("utf-8").replace("fps = 5.0", "fps = 4.0")
    file.write_text(sample.replace('kind = "virtual"', 'kind = "virtual"\nsamples = 1'), "utf-8")
    return file


@contextmanager
def found_by_scripts(stack: Stack) -> Iterator[None]:
    """What connects in this process, or in one that it starts, finds this stack."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("GEMELO_CONFIG", raising=False)
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        yield


@pytest.fixture(scope="session")
def shared_stacks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedStacks]:
    stacks = SharedStacks(tmp_path_factory.mktemp("stacks"))
    yield stacks
    stacks.stop()


@pytest.fixture(scope="module")
def rm1_stack(shared_stacks: SharedStacks) -> Stack:
    """Every process but viewer, page and cameras."""
    return shared_stacks.lend("rm1_stack")


@pytest.fixture(scope="module")
def panel_stack(shared_stacks: SharedStacks) -> Stack:
    """rm1 with the operator's page."""
    return shared_stacks.lend("panel_stack")


@pytest.fixture(scope="module")
def cell_stack(shared_stacks: SharedStacks) -> Stack:
    """rm1 in its sample cell, with the page."""
    return shared_stacks.lend("cell_stack")


@pytest.fixture(scope="module")
def parol6_stack(shared_stacks: SharedStacks) -> Stack:
    """The arm with six joints, with its page."""
    return shared_stacks.lend("parol6_stack")


@pytest.fixture(autouse=True)
def left_as_found(request: pytest.FixtureRequest) -> Iterator[None]:
    """Where a test has a shared stack: afterwards that is led back to how it was, and what the test left fails it.

    The arm stands at home when a test begins.
    """
    name = kind_of(request.node)
    stacks: SharedStacks = request.getfixturevalue("shared_stacks")
    if not name:
        stacks.stop()  # the tests that share one are over; this one may start its own
        yield
        return
    reset = stacks.reset(name)
    try:
        before = reset.before()
    except gemelo.Error:  # not the test's doing: on a machine without time for it the device was silent on the way home
        stacks.restart()
        reset = stacks.reset(name)
        before = reset.before()
    yield
    try:
        left = reset.after(before)
    except BaseException:
        stacks.restart()  # the next test finds one that is as new
        raise
    assert left == [], f"{request.node.nodeid} left behind: " + "; ".join(left)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Only in `make test-all`; those of one stack follow one another, and all that see a page are in one worker."""
    for item in items:
        if kind := kind_of(item):
            item.add_marker(pytest.mark.full)
        if kind or "chromium" in _fixtures(item):
            item.add_marker(pytest.mark.xdist_group("scripts" if kind == "rm1_stack" else "pages"))
    order = ["", *KINDS]
    items.sort(key=lambda item: order.index(kind_of(item)))


def kind_of(item: pytest.Item) -> str:
    """The shared stack that a test uses; empty where it uses none."""
    return next((name for name in KINDS if name in _fixtures(item)), "")


def _fixtures(item: pytest.Item) -> Sequence[str]:
    return getattr(item, "fixturenames", ())
