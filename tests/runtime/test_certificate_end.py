"""A certificate that ends soon is told by the process that shows it, at its start and on every day that it runs."""

from __future__ import annotations

import os
import ssl
import subprocess
import sys
from binascii import a2b_base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.expiry import CERTIFICATE, DAY, expiries, expiry, not_after
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.certificate_watch import CertificateWatch
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.topics import LOG
from tests.openssl import openssl
from tests.optional import need
from tests.runtime.locks import Lock, LockedRouter
from tests.runtime.support import ROOT, free_port, hear, spinning, until

TOLD = "ends in 12 days, and every link with it"
A_SHORT_DAY = """
from gemelo.libraries.runtime import certificate_watch
certificate_watch.PERIOD = 0.1
from {module} import main
raise SystemExit(main())
"""


def issued(folder: Path, days: int) -> Path:
    authority = Authority(folder / "ca.pem", folder / "ca.key")
    authority.sign_client("planner", folder / "planner.pem", folder / "planner.key", days=days)
    return folder / "planner.pem"


@pytest.fixture(scope="module")
def der(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    text = issued(tmp_path_factory.mktemp("der"), 365).read_text()
    return a2b_base64(CERTIFICATE.findall(text)[0])


@pytest.mark.parametrize("days", [-1, 0, 1, 365, 3650, 20_000])  # the last is written with four digits of the year
def test_the_end_of_a_certificate_is_what_openssl_says(tmp_path: Path, days: int) -> None:
    said = openssl("x509", "-in", str(issued(tmp_path, days)), "-noout", "-enddate")
    assert expiry(tmp_path / "planner.pem") == ssl.cert_time_to_seconds(said.strip().removeprefix("notAfter="))


def test_every_certificate_of_a_file_is_read(tmp_path: Path) -> None:
    both = tmp_path / "both.pem"
    both.write_text(issued(tmp_path, 1).read_text() + (tmp_path / "ca.pem").read_text())
    assert expiries(both) == (expiry(tmp_path / "planner.pem"), expiry(tmp_path / "ca.pem"))


def test_a_file_without_a_certificate_is_named(tmp_path: Path) -> None:
    file = tmp_path / "planner.pem"
    with pytest.raises(AccessError, match=f"cannot read {file}"):
        expiry(file)
    for text in ("", "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n", "ñ"):
        file.write_text(text)
        with pytest.raises(AccessError, match=f"{file} holds no certificate in PEM: `gemelo deploy keys` makes it"):
            expiry(file)


@given(cut=st.integers(0, 200), changed=st.integers(0, 200), value=st.integers(0, 255))
def test_bytes_that_are_no_certificate_are_refused_and_break_nothing(
    der: bytes, cut: int, changed: int, value: int
) -> None:
    with pytest.raises(ValueError, match=r"no certificate|longer"):
        not_after(der[:cut])
    damaged = der[:changed] + bytes([value]) + der[changed + 1 :]
    try:
        assert isinstance(not_after(damaged), float)
    except ValueError:
        assert damaged != der


def test_it_is_said_once_a_day_in_the_last_month_and_not_before(tmp_path: Path) -> None:
    said: list[str] = []
    start = expiry(issued(tmp_path, 40)) - 40 * DAY
    now = [start]
    watch = CertificateWatch(str(tmp_path / "planner.pem"), said.append, now=lambda: now[0])
    counts = []
    for hour in range(45 * 24):
        now[0] = start + hour * DAY / 24
        watch.beat()
        counts.append(len(said))
    assert counts[9 * 24] == 0
    assert counts[-1] == 35  # of days 10 to 44
    assert max(after - before for before, after in zip(counts, counts[24:], strict=False)) == 1
    assert "planner.pem ends in 30 days" in said[0]
    assert "`gemelo deploy keys` renews it" in said[0]
    assert "planner.pem has expired" in said[-1]


def test_a_newer_file_asks_for_a_new_start_as_links_keep_what_they_were_opened_with(tmp_path: Path) -> None:
    said: list[str] = []
    watch = CertificateWatch(str(issued(tmp_path, 12)), said.append)
    issued(tmp_path, 365)
    watch.beat()
    assert TOLD in said[0]
    assert "a newer one is there, so start this process anew" in said[0]


def test_without_tls_nothing_ends_and_nothing_is_said() -> None:
    said: list[str] = []
    watch = CertificateWatch("", said.append)
    watch.beat()
    assert (watch.ends, said) == (None, [])


@pytest.fixture(scope="module")
def lock(tmp_path_factory: pytest.TempPathFactory) -> Lock:
    return Lock(tmp_path_factory.mktemp("lock"), roles=("state_publisher", "logger"), days=12)


def test_a_node_that_runs_says_it_again_on_the_bus_and_in_its_info(
    lock: Lock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gemelo.libraries.runtime.certificate_watch.PERIOD", 0.1)
    router = LockedRouter(tmp_path / "router", lock)
    nodes = [
        Node(name, replace(router.deployment, router=router.section(name)), robot="rm1", stop=ShutdownRequest())
        for name in ("state_publisher", "logger")
    ]
    said: list[str] = []
    nodes[1].subscribe(LOG, lambda record: said.append(record.text))
    try:
        with spinning(nodes[0]):
            assert hear(nodes[1], lambda: sum(TOLD in each for each in said) >= 2, 10.0)
        assert nodes[0].info().certificate_ends == expiry(lock.files("state_publisher")[0])
    finally:
        for node in nodes:
            node.close()
        router.stop()


@contextmanager
def a_day_is_short(module: str, log: Path, **environ: str) -> Iterator[Path]:
    """The real process of `module`, which looks at its certificate ten times a second; its log."""
    with log.open("w") as file:
        process = subprocess.Popen(
            [sys.executable, "-c", A_SHORT_DAY.format(module=module)], cwd=ROOT, stderr=file, env=os.environ | environ
        )
        try:
            yield log
        finally:
            process.terminate()
            process.wait(timeout=60.0)


def test_a_router_that_runs_says_it_again(lock: Lock, tmp_path: Path) -> None:
    port = free_port()
    settings = {"GEMELO_ROUTER_CONFIGURATION": str(lock.write_router(port)), "GEMELO_PATHS_RUN": str(tmp_path / "run")}
    with a_day_is_short("gemelo.services.router.main", tmp_path / "log", **settings) as log:
        assert until(lambda: log.read_text().count(f"router.pem {TOLD}") >= 2, 20.0), log.read_text()


def test_a_broker_that_runs_says_it_again(tmp_path: Path) -> None:
    need("mosquitto")
    secure_folder.make(tmp_path / "lock", ["127.0.0.1"], ["rm1"], days=12)
    settings = {
        "GEMELO_MQTT_BROKER": "mosquitto", "GEMELO_MQTT_PORT": str(free_port()),
        "GEMELO_MQTT_SECURE_FOLDER": str(tmp_path / "lock"), "GEMELO_PATHS_RUN": str(tmp_path / "run"),
    }  # fmt: skip
    with a_day_is_short("gemelo.services.broker.main", tmp_path / "log", **settings) as log:
        assert until(lambda: log.read_text().count(f"server.pem {TOLD}") >= 2, 20.0), log.read_text()
