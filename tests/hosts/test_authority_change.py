"""A new authority takes the place of the old one while hosts have certificates of either: nobody is refused."""

from __future__ import annotations

import shutil
import socket
import ssl
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import pytest

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.expiry import CERTIFICATE, expiries
from gemelo.libraries.mqtt.access import tls_context
from gemelo.libraries.runtime.bus.zenoh_bus import BusNotOpen, ZenohBus
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.deployment import Broker, MqttSection
from gemelo.tools.cli.hosts.credentials import LONGEST_PEM
from gemelo.tools.cli.main import run
from gemelo.tools.hosts.keys import authority_in, make_keys
from tests.hosts.site_router import SiteRouter
from tests.openssl import openssl
from tests.runtime.support import free_port, until
from tests.stepper_gateway.locked import Mosquitto

BEFORE, CHANGING, AFTER = "before", "changing", "after"
PHASES = (BEFORE, CHANGING, AFTER)
REFUSED = {(BEFORE, AFTER), (AFTER, BEFORE)}  # of a server and its client


@pytest.fixture(scope="module")
def routers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, SiteRouter]]:
    """A router with the files that its host has in each phase; all were made one after the other by one site's keys."""
    folder = tmp_path_factory.mktemp("site")
    first = SiteRouter(folder / BEFORE)
    found = {BEFORE: first}
    keys = folder / "keys"
    shutil.copytree(first.home, keys)
    for phase in PHASES[1:]:
        authority = authority_in(keys)
        authority.renew() if phase == CHANGING else authority.retire()
        make_keys(first.site, keys, project_root())
        found[phase] = SiteRouter(folder / phase, keys)
    yield found
    for each in found.values():
        each.stop()


def joins(router: SiteRouter, client: SiteRouter) -> bool:
    try:
        bus = ZenohBus(router.section("operator", client.keys), "rm1")
    except BusNotOpen:
        return False
    bus.close()
    return True


def test_a_host_with_old_files_and_one_with_new_ones_take_each_other_until_the_old_authority_is_retired(
    routers: dict[str, SiteRouter],
) -> None:
    pairs = list(product(PHASES, PHASES))
    with ThreadPoolExecutor(len(pairs)) as pool:
        joined = dict(zip(pairs, pool.map(lambda pair: joins(*map(routers.get, pair)), pairs), strict=True))
    assert joined == {pair: pair not in REFUSED for pair in pairs}


def test_a_certificate_that_the_old_authority_vouches_for_still_says_its_role(routers: dict[str, SiteRouter]) -> None:
    """Of a router that knows only the old authority: what is no role may say nothing there."""
    old, keys = routers[BEFORE], routers[CHANGING].keys
    buses = [ZenohBus(old.section("operator", keys), "rm1"), ZenohBus(old.section("viewer", keys), "rm1")]
    keys_of = {f"@alive/{bus.common_name}/cli-1": bus for bus in buses}
    tokens = [bus.declare_alive(key) for key, bus in keys_of.items()]
    assert until(lambda: all(keys_of.keys() <= bus.alive("@alive/*/*") for bus in buses))
    for each in (*tokens, *buses):
        each.close()


@pytest.mark.parametrize("server", PHASES)
def test_a_broker_with_old_or_new_files_is_believed_by_the_same(
    routers: dict[str, SiteRouter], server: str, tmp_path: Path
) -> None:
    folder = routers[server].home / "one/broker"
    section = MqttSection(broker=Broker.MOSQUITTO, port=free_port(), secure_folder=str(folder))
    broker = Mosquitto(tmp_path, section)
    try:
        believed = {client: believes(routers[client].home / "one/broker/ca.pem", section.port) for client in PHASES}
    finally:
        broker.close()
    assert believed == {client: (server, client) not in REFUSED for client in PHASES}


def believes(authority: Path, port: int) -> bool:
    """As gateway and virtual device do."""
    try:
        with (
            socket.create_connection(("127.0.0.1", port), 5.0) as plain,
            tls_context(str(authority)).wrap_socket(plain, server_hostname="127.0.0.1"),
        ):
            return True
    except ssl.SSLCertVerificationError:
        return False


def test_the_old_authoritys_key_is_gone_and_a_board_has_room_for_what_it_is_to_trust(
    routers: dict[str, SiteRouter],
) -> None:
    before, changing, after = (routers[phase].home for phase in PHASES)
    old_key = (before / "authority/ca.key").read_bytes()
    assert not any(file.read_bytes() == old_key for file in changing.rglob("*.key"))
    trusted = (changing / "one/broker/ca.pem").read_text()
    assert len(CERTIFICATE.findall(trusted)) == 2
    assert len(trusted) <= LONGEST_PEM
    assert len(expiries(after / "one/keys/ca.pem")) == len(expiries(after / "one/keys/router.pem")) == 1
    assert {file.stat().st_mode & 0o777 for file in (*changing.rglob("*.key"), *after.rglob("*.key"))} == {0o600}
    assert not list((after / "authority").glob("former*"))


def test_a_certificate_that_is_renewed_meanwhile_is_vouched_for_too_and_kept_when_it_is(tmp_path: Path) -> None:
    authority = Authority(tmp_path / "ca.pem", tmp_path / "ca.key")
    old = tmp_path / "old.pem"
    shutil.copyfile(tmp_path / "ca.pem", old)
    files = (tmp_path / "planner.pem", tmp_path / "planner.key")
    authority.sign_client("planner", *files)
    assert authority.has_signed(*files)
    authority.renew()
    again = Authority(tmp_path / "ca.pem", tmp_path / "ca.key")
    assert not again.has_signed(*files)
    again.sign_client("planner", *files)
    assert again.has_signed(*files)
    assert "OK" in openssl("verify", "-CAfile", str(old), "-untrusted", str(files[0]), str(files[0]))
    again.retire()
    assert not again.has_signed(*files)  # the old one's word is of no use any more


def gemelo(*words: str) -> int:
    return int(run(words))


def test_the_command_says_when_the_authority_ends_and_leads_through_its_change(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "out"))
    assert gemelo("deploy", "keys", "example", "--retire-authority") == 1
    assert "no former authority is trusted" in capsys.readouterr().err
    assert gemelo("deploy", "keys", "example") == 0
    said = capsys.readouterr().out
    assert "the authority ends on 20" in said
    assert "(3650 days)" in said
    assert "outlive" not in said
    assert gemelo("deploy", "keys", "example", "--renew-authority") == 0
    said = capsys.readouterr().out
    assert "kept" not in said
    assert "trusted too, until `gemelo deploy keys example --retire-authority`" in said
    assert gemelo("deploy", "keys", "example", "--renew-authority") == 1
    assert "retire that one before" in capsys.readouterr().err
    assert gemelo("deploy", "check", "example") == 0
    assert "--retire-authority" in capsys.readouterr().out
    assert gemelo("deploy", "keys", "example", "--retire-authority") == 0
    assert "trusted too" not in capsys.readouterr().out


def test_an_authority_that_certificates_would_outlive_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_PATHS_OUT", str(tmp_path / "out"))
    monkeypatch.setattr("gemelo.libraries.credentials.authority.DAYS", 390)
    assert gemelo("deploy", "keys", "example") == 0
    assert "`gemelo deploy keys example --renew-authority` makes another one" in capsys.readouterr().out
