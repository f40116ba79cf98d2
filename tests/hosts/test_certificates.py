"""The remaining validity of certificates, for each host: of those made here, and of those that the site presents."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from msgspec.structs import replace

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.expiry import DAY, expiry
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Broker, MqttSection
from gemelo.schemas.device import DeviceStatus
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.tools.cli.main import run
from gemelo.tools.hosts.certificates import Certificate, days_by_host, endings, older, shown_at
from tests.hosts.site_router import SiteRouter
from tests.runtime.locks import HOST, Lock, LockedRouter
from tests.runtime.support import free_port, spinning
from tests.stepper_gateway.locked import Mosquitto


def test_the_first_that_ends_counts_for_a_host_and_what_ends_within_a_month_is_named():
    now = time.time()
    found = [Certificate("cell", "gateway", now + 300 * DAY), Certificate("cell", "router", now + 29 * DAY),
             Certificate("desk", "operator", now - DAY), Certificate("brain", "planner", now + 31 * DAY)]  # fmt: skip
    left = {host: str(days) for host, days in days_by_host(found, now).items()}
    assert left == {"cell": "29 days", "desk": "expired", "brain": "31 days"}
    ends, expired = endings(found, now)
    assert (ends.code, ends.values["name"], ends.values["host"]) == ("site.certificate.ends", "router", "cell")
    assert ends.values["days"] == pytest.approx(29.0)
    assert expired == because("site.certificate.expired", name="operator", host="desk")


def test_what_runs_with_an_older_certificate_than_was_made_for_it_is_named():
    now = time.time()
    here = [Certificate("cell", "gateway", now + 365 * DAY), Certificate("brain", "planner", now + 365 * DAY)]
    running = [Certificate("cell", "gateway", now + 200 * DAY), here[1], Certificate("desk", "panel", now)]
    assert older(running, here) == (because("site.certificate.older", name="gateway", host="cell"),)


def test_check_says_it_of_the_keys_that_are_here(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "out"))
    assert run(["deploy", "check", "example"]) == 0
    assert "days" not in capsys.readouterr().out
    assert run(["deploy", "keys", "example"]) == 0
    capsys.readouterr()
    assert run(["deploy", "check", "example"]) == 0
    said = capsys.readouterr().out
    assert said.count("365 days") == 3
    assert "ends in" not in said
    folder = tmp_path / "out/deploy/example"
    authority = Authority(folder / "authority/ca.pem", folder / "authority/ca.key")
    authority.sign_client("planner", folder / "brain/keys/planner.pem", folder / "brain/keys/planner.key", days=12)
    assert run(["deploy", "check", "example"]) == 0
    said = capsys.readouterr().out
    assert said.count("365 days") == 2
    assert "the certificate of planner on brain ends in 12 days\n`gemelo deploy keys example` renews" in said
    (folder / "brain/keys/planner.pem").write_text("nothing")
    assert run(["deploy", "check", "example"]) == 1
    assert "planner.pem holds no certificate" in capsys.readouterr().err


@pytest.mark.parametrize("days", [-1, 12, 365])
def test_what_a_router_shows_is_seen_also_when_it_has_expired(tmp_path, days):
    lock = Lock(tmp_path / "lock", roles=("operator",), days=days)
    router = LockedRouter(tmp_path / "router", lock)
    try:
        shown = shown_at(HOST, router.port, *map(str, lock.files("operator")))
        assert shown == expiry(lock.files("router")[0])
    finally:
        router.stop()
    assert shown_at(HOST, router.port) is None


def test_what_a_broker_shows_is_seen(tmp_path):
    secure_folder.make(tmp_path / "lock", [HOST], ["rm1"], days=12)
    section = MqttSection(broker=Broker.MOSQUITTO, port=free_port(), secure_folder=str(tmp_path / "lock"))
    broker = Mosquitto(tmp_path, section)
    try:
        assert shown_at(HOST, section.port) == expiry(tmp_path / "lock/server.pem")
    finally:
        broker.close()


@pytest.fixture
def router(tmp_path) -> Iterator[SiteRouter]:
    router = SiteRouter(tmp_path, days=20)
    yield router
    router.stop()


def test_status_says_it_of_every_host_and_names_what_ends_within_a_month(router, monkeypatch, capsys):
    own = router.section("operator")
    monkeypatch.setenv("GEMELO_ROUTER_TLS", "true")
    for name in ("port", "ca", "certificate", "key"):
        monkeypatch.setenv(f"GEMELO_ROUTER_{name.upper()}", str(getattr(own, name)))
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(router.out))
    with ExitStack() as alive:
        deployment = replace(router.deployment, router=router.section("gateway"))
        gateway = Node("stepper_gateway", deployment, robot="rm1", stop=ShutdownRequest())
        alive.enter_context(gateway)
        alive.enter_context(spinning(gateway))
        gateway.set_ready(True)
        gateway.publisher(DEVICE_STATUS).put(DeviceStatus(online=True, device="rm1"))
        assert run(["deploy", "status", str(router.site_file)]) == 1  # there is no state_publisher
        said = capsys.readouterr().out
        assert "certificates: one 20 days, yours 20 days" in said
        for name in ("gateway on one", "router on one", "operator on this host"):
            assert f"the certificate of {name} ends in 20 days" in said
        assert f"the certificate of state_publisher on one ends in 20 days, by the file in {router.folder}" in said
        assert "`gemelo deploy keys lab` renews what ends within 30 days" in said
        assert "an older certificate" not in said
        run(["deploy", "status", str(router.site_file), "--json"])
        found = {each["service"]: each["certificate_ends"] for each in json.loads(capsys.readouterr().out)}
    ends = {each.name: each.expires for each in router.made}
    assert found == {
        "router": ends["router"], "broker": None, "stepper_gateway": ends["gateway"], "state_publisher": None,
    }  # fmt: skip
