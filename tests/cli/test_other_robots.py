"""A command for a robot that is not on the router names those that are: on a router and nodes of its own."""

from __future__ import annotations

import pytest

from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.running import robots_on
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch import state
from tests.runtime.support import RouterProcess


@pytest.fixture
def router(tmp_path, monkeypatch):
    process = RouterProcess(tmp_path)
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(process.port))
    yield process
    process.kill()


@pytest.fixture
def parol6(router):
    """A gateway of another robot."""
    with Node("stepper_gateway", router.deployment, robot="parol6", stop=ShutdownRequest()) as node:
        yield node


def test_the_robots_of_a_router_are_those_with_the_node_asked_for(router, parol6):
    with Node("planner", router.deployment, robot="other", stop=ShutdownRequest()):
        assert robots_on(router.deployment.router) == ("other", "parol6")
        assert robots_on(router.deployment.router, "stepper_gateway") == ("parol6",)


def test_a_router_without_nodes_has_no_robots(router):
    assert robots_on(router.deployment.router) == ()


@pytest.mark.parametrize("words", [["state"], ["request", "call", "fk"], ["hold"], ["device", "status"]])
def test_a_command_for_a_robot_that_is_not_there_names_the_one_that_is(router, parol6, words, monkeypatch, capsys):
    monkeypatch.setattr(state, "PATIENCE", 0.2)
    monkeypatch.setenv("GEMELO_ROBOT", "urdf/rm1")
    assert run(words) is ExitCode.NO_STACK
    error = capsys.readouterr().err
    assert f"the router at 127.0.0.1:{router.port} has no rm1, but parol6" in error
    assert "`gemelo --robot parol6 ...` speaks with it" in error


def test_a_router_with_nobody_says_what_does_not_run(router, monkeypatch, capsys):
    monkeypatch.setattr(state, "PATIENCE", 0.2)
    assert run(["state"]) is ExitCode.NO_STACK
    assert "is stepper_gateway running?" in capsys.readouterr().err
