"""An arm whose files are elsewhere: a router in a process of its own, and nodes that say what a twin says."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import gemelo
from gemelo.api.addresses import parsed
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.topics import DESCRIPTION
from gemelo.services.state_publisher.main import describe
from tests.runtime.support import RouterProcess


@pytest.fixture
def router(tmp_path: Path) -> Iterator[RouterProcess]:
    process = RouterProcess(tmp_path)
    yield process
    process.kill()


class Twins:
    """Of each robot a gateway, and a state publisher that describes it."""

    def __init__(self, router: RouterProcess, stack: ExitStack) -> None:
        self.address, self._router, self._stack = f"tcp/127.0.0.1:{router.port}", router, stack

    def add(self, robot: str, is_described: bool = True) -> None:
        for name in ("stepper_gateway", "state_publisher"):
            node = Node(name, self._router.deployment, robot=robot, stop=ShutdownRequest())
            self._stack.enter_context(node)
            if name == "state_publisher" and is_described:
                node.publisher(DESCRIPTION).put(describe(load_arm(project_root() / "urdf" / robot)))


@pytest.fixture
def twins(router: RouterProcess) -> Iterator[Twins]:
    with ExitStack() as stack:
        yield Twins(router, stack)


def test_the_arm_at_an_address_is_that_of_its_files(twins: Twins) -> None:
    twins.add("rm1")
    with gemelo.connect(twins.address) as arm:
        assert arm.joint_names == load_arm(project_root() / "urdf/rm1").joint_names
        assert arm.description.named_states == load_arm(project_root() / "urdf/rm1").named_states


def test_one_of_several_arms_is_named_behind_the_address(twins: Twins) -> None:
    twins.add("rm1")
    twins.add("parol6")
    with pytest.raises(gemelo.Error) as several:
        gemelo.connect(twins.address)
    assert several.value.reason is not None
    assert (several.value.reason.code, several.value.reason.values["robots"]) == ("address.several", ("parol6", "rm1"))
    with gemelo.connect(f"{twins.address}/parol6") as arm:
        assert len(arm.joint_names) == 6
    with pytest.raises(gemelo.Lost, match="there is no arm"):
        gemelo.connect(f"{twins.address}/other")


def test_an_arm_that_does_not_describe_itself_is_said(twins: Twins, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.api.bus_files.PATIENCE", 0.3)
    twins.add("rm1", is_described=False)
    with pytest.raises(gemelo.Lost, match="is its state_publisher running"):
        gemelo.connect(twins.address)


def test_a_router_that_is_not_there_is_said() -> None:
    with pytest.raises(gemelo.Lost, match=r"no arm at tcp/127\.0\.0\.1:1"):
        gemelo.connect("tcp/127.0.0.1:1")


@pytest.mark.parametrize(
    "address", ["tcp/", "tcp/:7447", "tcp/lab:", "tcp/lab:0", "tcp/lab:70000", "tcp/lab:7447/a/b", "tcp/lab:x"]
)
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(gemelo.BadArgument, match="is no address of a router"):
        gemelo.connect(address)


def test_an_address_with_tls_wants_a_deployment_file() -> None:
    with pytest.raises(gemelo.BadArgument, match="wants certificates"):
        gemelo.connect("tls/lab:7447")


def test_a_port_that_is_not_said_is_zenoh_s() -> None:
    router, name = parsed("tcp/lab")
    assert (router.host, router.port, name) == ("lab", 7447, "")


def test_the_command_line_needs_no_file_either(twins: Twins, tmp_path: Path) -> None:
    """In a folder of a user's, with a schemas.py and a pyproject.toml of his own."""
    twins.add("rm1")
    (tmp_path / "schemas.py").write_text("raise RuntimeError('this is another one')\n")
    (tmp_path / "pyproject.toml").write_text("[project]\nname = 'mine'\n")
    words = [Path(sys.executable).parent / "gemelo", "--robot", twins.address, "node", "list"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert "stepper_gateway" in done.stdout, done.stderr
