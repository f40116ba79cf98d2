"""Three hosts with TLS, each with the files that `gemelo deploy` has made for it: the arm, the planner, the desk."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.hosts.checks import load_site
from tests.optional import need, need_root
from tests.stack.namespaces import Hosts, Lab

SITE = """
[router]
host = "brain"
[broker]
host = "cell"
[robots.rm1]
folder = "urdf/rm1"
[hosts.cell]
address = "10.77.0.1"
[hosts.cell.services]
rm1 = ["stepper_gateway", "virtual_esp32", "state_publisher"]
[hosts.brain]
address = "10.77.0.2"
[hosts.brain.services]
rm1 = ["planner"]
[hosts.desk]
address = "10.77.0.3"
roles = ["operator", "viewer"]
"""
# Beside a busy process the kernel measures longer round trips, sends again later after a cut, and a client that hears
# nothing for 2 s holds its gateway for lost.
pytestmark = pytest.mark.alone
CUT = 1.0  # [s]
NODES = {"stepper_gateway": "cell", "state_publisher": "cell", "planner": "brain"}
ON = NODES | {"virtual_esp32": "cell", "broker": "cell", "router": "brain"}


@pytest.fixture(scope="module")
def hosts(tmp_path_factory) -> Iterator[tuple[Hosts, Lab]]:
    need("mosquitto")
    need_root("tests/stack/test_hosts.py")
    folder = tmp_path_factory.mktemp("lab")
    file = folder / "lab.toml"
    file.write_text(SITE)
    site = load_site(file, project_root())
    with Hosts(site) as made, Lab(site, made, folder / "out") as lab:
        yield made, lab


@pytest.fixture(scope="module")
def desk(hosts) -> Iterator[subprocess.Popen[str]]:
    made, lab = hosts
    with subprocess.Popen(
        made.command("desk", sys.executable, "-m", "tests.stack.desk"), cwd=project_root(), text=True, bufsize=1,
        env=lab.environment("desk", "rm1"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout.readline() == '{"ready": "SUCCEEDED"}\n', lab.logs()
        yield process
        process.stdin.close()


def gemelo(hosts, *words: str, role: str = "operator") -> subprocess.CompletedProcess[str]:
    made, lab = hosts
    keys = f"{lab.sites['desk'].config}/keys"
    shown = {"GEMELO_ROUTER_CERTIFICATE": f"{keys}/{role}.pem", "GEMELO_ROUTER_KEY": f"{keys}/{role}.key"}
    return subprocess.run(
        made.command("desk", sys.executable, "-m", "gemelo.tools.cli.main", *words), cwd=project_root(), text=True,
        env=lab.environment("desk", "rm1") | shown, capture_output=True, timeout=60.0,
    )  # fmt: skip


@pytest.mark.parametrize("host", ["desk", "cell"])
def test_a_move_from_the_desk_goes_on_exactly_when_a_link_is_cut_and_healed(hosts, desk, host):
    made, _ = hosts
    desk.stdin.write("move\n")
    assert desk.stdout.readline() == "moving\n"
    with made.cut(host):
        time.sleep(CUT)  # how long the link is down is what this is about
    outcome = json.loads(desk.stdout.readline())
    assert outcome["status"] == "SUCCEEDED", outcome
    assert outcome["longest_gap"] > CUT / 2, "the cut was not felt"
    assert {key: outcome[key] for key in ("status", "is_exact", "jumps", "positions_afterwards")} == {
        "status": "SUCCEEDED", "is_exact": True, "jumps": [], "positions_afterwards": 1,
    }  # fmt: skip


def status(hosts, *, role: str = "viewer") -> tuple[int, dict[str, dict[str, object]]]:
    """The exit code of `gemelo deploy status` at the desk, and what it says of each service."""
    done = gemelo(hosts, "deploy", "status", site_file(hosts), "--json", role=role)
    assert done.stdout, done.stderr
    return done.returncode, {each["service"]: each for each in json.loads(done.stdout)}


def site_file(hosts) -> str:
    """As a person at the desk has it."""
    return str(Path(hosts[1].sites["desk"].config).parent.with_name("lab.toml"))


def until_all_are_ready(hosts) -> dict[str, dict[str, object]]:
    end = time.monotonic() + 30.0
    while (found := status(hosts))[0] != 0:
        assert time.monotonic() < end, found
    return found[1]


def test_the_status_at_the_desk_has_every_service_with_its_host_its_version_and_its_clock(hosts):
    found = until_all_are_ready(hosts)
    assert {name: each["host"] for name, each in found.items()} == ON
    assert all(each["standing"] == "ready" for each in found.values())
    for name in NODES:
        assert (found[name]["machine"], found[name]["version"]) == (ON[name], version("gemelo"))
        assert found[name]["clock_bound"] > 0.0
        assert abs(found[name]["clock_offset"]) <= found[name]["clock_bound"], "their clocks are one here"
    table = gemelo(hosts, "deploy", "status", site_file(hosts), role="viewer").stdout
    assert "all 6 are ready" in table


def test_what_is_behind_a_cut_link_is_told_as_silent_and_all_are_ready_again_when_it_is_healed(hosts):
    made, _ = hosts
    with made.cut("cell"):
        code, found = status(hosts)
    assert code == 1
    standing = {name: each["standing"] for name, each in found.items()}
    planner = standing.pop("planner")
    assert planner == "ready" or (planner, "joint" in found["planner"]["reason"]) == ("not ready", True), found
    assert standing == {
        "stepper_gateway": "silent", "state_publisher": "silent", "virtual_esp32": "unknown", "broker": "unknown",
        "router": "ready",
    }  # fmt: skip
    until_all_are_ready(hosts)


def test_without_the_routers_host_the_status_names_the_address_that_does_not_answer(hosts):
    made, _ = hosts
    with made.cut("brain"):
        done = gemelo(hosts, "deploy", "status", site_file(hosts))
    assert done.returncode not in (0, 1)
    assert "no router at 10.77.0.2:7447: is that host on, does it answer `ping 10.77.0.2` from here" in done.stderr
    until_all_are_ready(hosts)


def test_a_viewer_sees_the_arm_may_stop_it_and_cannot_move_it(hosts):
    assert "brazo_joint" in gemelo(hosts, "state", role="viewer").stdout
    refused = gemelo(hosts, "move", "--named", "ready", role="viewer")
    assert refused.returncode != 0
    assert "nobody serves plan to" in refused.stderr
    assert "viewer.pem: is planner running, and may this role ask it?" in refused.stderr
    stopped = gemelo(hosts, "stop", role="viewer")
    assert stopped.returncode == 0, stopped.stderr
    assert gemelo(hosts, "param", "set", "planner", "planning_time", "1.0", role="viewer").returncode != 0
