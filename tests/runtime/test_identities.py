"""Admission to a locked router: only with a certificate of its authority that is valid today."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import msgspec
import pytest
import zenoh

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.runtime.bus.connection import connect, refusal, require_certificate
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.topics import PLAN
from tests.runtime.locks import Lock, LockedRouter
from tests.runtime.support import RouterProcess, until


@pytest.fixture(scope="module")
def lock(tmp_path_factory) -> Lock:
    lock = Lock(tmp_path_factory.mktemp("lock"), roles=("viewer", "operator", "stranger"))
    lock.authority.sign_client("operator", *lock.files("expired"), days=-1)
    foreign = Authority(lock.folder / "foreign.pem", lock.folder / "foreign.key")
    foreign.sign_client("operator", *lock.files("foreigner"))
    return lock


@pytest.fixture(scope="module")
def router(lock, tmp_path_factory) -> Iterator[LockedRouter]:
    router = LockedRouter(tmp_path_factory.mktemp("router"), lock)
    yield router
    router.stop()


def joins(section: RouterSection) -> bool:
    config = client_config(section, "rm1")
    if section.tls and not section.certificate:
        config.insert_json5("transport/link/tls/enable_mtls", "false")
    try:
        zenoh.open(config).close()
    except zenoh.ZError:
        return False
    return True


def test_a_router_that_does_not_ask_takes_everybody_and_a_locked_one_only_certificates_of_its_authority(
    router, lock, tmp_path
):
    def joined(router: LockedRouter) -> set[str]:
        """Of those who have no right to."""
        own = router.section("operator")
        strangers = {
            "without TLS": RouterSection(port=router.port),
            "without a certificate": msgspec.structs.replace(own, certificate="", key=""),
            "expired": router.section("expired"),
            "of a foreign authority": router.section("foreigner"),
            "who trusts another authority": msgspec.structs.replace(own, ca=str(lock.folder / "foreign.pem")),
        }
        with ThreadPoolExecutor(len(strangers)) as pool:  # each waits 2 s for the router
            return {name for name, has in zip(strangers, pool.map(joins, strangers.values()), strict=True) if has}

    assert joined(router) == set()
    assert joins(router.section("operator"))
    assert refusal(router.section("operator")) == ""
    unasked, plain = LockedRouter(tmp_path / "unasked", lock, asks=False), RouterProcess(tmp_path / "plain")
    # The last one is the client's own lock: it does not believe that this is its router.
    assert joined(unasked) == {"without a certificate", "expired", "of a foreign authority"}
    assert joins(RouterSection(port=plain.port))
    unasked.stop()
    plain.stop()


@pytest.mark.parametrize(
    ("name", "reason"),
    [("expired", "expired.pem has expired: `gemelo deploy keys` renews it"),
     ("foreigner", "foreigner.pem, which its own authority must have signed")],
)  # fmt: skip
def test_who_waits_for_the_router_is_told_why_it_is_refused(router, name, reason):
    stop, log, said = ShutdownRequest(), logging.getLogger(name), []
    log.addHandler(handler := logging.Handler())
    handler.emit = lambda record: (said.append(record.getMessage()), stop.set())
    with pytest.raises(SystemExit):
        connect(router.section(name), "rm1", log, stop)
    assert reason in said[0]


def test_a_router_of_a_foreign_authority_or_another_address_is_named(router, lock):
    own = router.section("operator")
    foreign = refusal(msgspec.structs.replace(own, ca=str(lock.folder / "foreign.pem")))
    assert f"the router's certificate is not one of {lock.folder / 'foreign.pem'} for 127.0.0.1" in foreign
    assert "mismatch" in refusal(msgspec.structs.replace(own, host="localhost"))


def test_a_name_that_is_no_role_may_nothing(router):
    stranger, viewer = ZenohBus(router.section("stranger"), "rm1"), ZenohBus(router.section("viewer"), "rm1")
    stranger.serve(PLAN.key, lambda query: query.drop())
    for bus, name in ((stranger, "stranger"), (viewer, "viewer")):
        bus.declare_alive(f"@alive/viewer/{name}")
    assert until(lambda: viewer.alive("@alive/*/*") == {"@alive/viewer/viewer"})
    assert stranger.alive("@alive/*/*") <= {"@alive/viewer/stranger"}
    assert not viewer.wait_served(PLAN.key, 0.2)
    stranger.close()
    viewer.close()


@pytest.mark.parametrize("name", ["ca", "certificate", "key"])
def test_tls_without_one_of_its_files_is_refused_by_name(lock, name):
    section = lock.section("operator", 1)
    require_certificate(section)
    with pytest.raises(BusError, match=f"router.tls is set, but router.{name} is not: .* gives the host `roles`"):
        require_certificate(msgspec.structs.replace(section, **{name: ""}))
    with pytest.raises(BusError, match=f"router.{name}: cannot read /nowhere"):
        require_certificate(msgspec.structs.replace(section, **{name: "/nowhere"}))
    with pytest.raises(BusError, match=r"set router.tls = true too"):
        require_certificate(msgspec.structs.replace(section, tls=False))


def test_a_key_that_others_can_read_is_refused(lock):
    section = lock.section("operator", 1)
    _, key = lock.files("operator")
    key.chmod(0o640)
    try:
        with pytest.raises(AccessError, match="has mode 640"):
            require_certificate(section)
    finally:
        key.chmod(0o600)
