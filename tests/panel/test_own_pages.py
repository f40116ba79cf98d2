"""Another site's page in the same browser cannot reach the arm; no stack is needed for it."""

from __future__ import annotations

import urllib.request
from collections.abc import Iterator, Mapping
from urllib.error import HTTPError

import msgspec
import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from gemelo.libraries.runtime.process.logs import line_logger
from gemelo.libraries.runtime.process.own_names import own_names
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PanelSection
from gemelo.services.panel.main import run
from gemelo.services.panel.view.broken_connections import BrokenConnections
from gemelo.services.panel.view.own_pages import OwnServer, objection, own_pages_only
from tests.panel.person import until

PROTOCOL = [f"viser-v{viser.__version__}"]


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with own_pages_only("127.0.0.1", BrokenConnections(print)):
        server = OwnServer("127.0.0.1", 0, verbose=False)
    yield f"127.0.0.1:{server.get_port()}"
    server.stop()


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "https://{address}.evil.example", "http://127.0.0.1:1", "null"]
)
def test_a_page_of_another_site_is_refused(address: str, origin: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://{address}", origin=origin.format(address=address), subprotocols=PROTOCOL)
    assert refused.value.response.status_code == 403
    assert b"may not lead the arm" in (refused.value.response.body or b"")


@pytest.mark.parametrize("origin", ["http://{address}", None])
def test_its_own_page_and_a_program_are_served(address: str, origin: str | None) -> None:
    with connect(f"ws://{address}", origin=origin and origin.format(address=address), subprotocols=PROTOCOL) as page:
        assert page.recv(timeout=10.0)
    with urllib.request.urlopen(f"http://{address}", timeout=60.0) as answer:
        assert answer.status == 200


def test_a_name_that_somebody_else_points_here_is_refused(address: str) -> None:
    request = urllib.request.Request(f"http://{address}", headers={"Host": "rebound.example:8088"})
    with pytest.raises(HTTPError, match="403"):
        urllib.request.urlopen(request, timeout=60.0)


@pytest.mark.parametrize("host", ["localhost:8088", "[::1]:8088", "192.168.1.7:8088", "lab-pc:8088", "LAB-PC"])
def test_this_machine_goes_by_its_names_and_addresses(host: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "lab-pc")
    assert objection(host, f"http://{host}", own_names("0.0.0.0")) == ""


def test_a_name_in_the_local_domain_counts_where_the_deployment_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever answers first to a question in the local network has such a name."""
    monkeypatch.setattr("socket.gethostname", lambda: "lab-pc")
    assert "[panel] name" in objection("lab-pc.local", None, own_names("0.0.0.0"))
    assert objection("lab-pc.local:8088", "http://lab-pc.local:8088", own_names("0.0.0.0", "Lab-PC.local")) == ""
    monkeypatch.setattr("socket.gethostname", lambda: "lab-pc.local")
    assert objection("lab-pc.local", None, own_names("0.0.0.0")) != ""


def answers(address: str) -> list[tuple[int, Mapping[str, str]]]:
    """Status and headers of a page, of one that is not there, of a refusal, and of a browser's connection."""
    found = []
    for path, headers in (("", {}), ("/none", {}), ("", {"Host": "rebound.example"})):
        try:
            answer = urllib.request.urlopen(urllib.request.Request(f"http://{address}{path}", headers=headers))
        except HTTPError as refused:
            answer = refused
        with answer:
            found.append((answer.status, answer.headers))
    with connect(f"ws://{address}", subprotocols=PROTOCOL) as page:
        assert page.response is not None
        found.append((page.response.status_code, page.response.headers))
    return found


def test_no_answer_may_be_shown_within_another_page(address: str) -> None:
    bare = viser.ViserServer("127.0.0.1", 0, verbose=False)
    try:
        assert not any("X-Frame-Options" in headers for _, headers in answers(f"127.0.0.1:{bare.get_port()}"))
    finally:
        bare.stop()
    said = answers(address)
    assert [status for status, _ in said] == [200, 404, 403, 101]
    for _, headers in said:
        assert headers["Content-Security-Policy"] == "frame-ancestors 'none'"
        assert headers["X-Frame-Options"] == "DENY"


def test_no_browser_gets_a_tunnel_through_a_server_of_others(address: str, capfd: pytest.CaptureFixture[str]) -> None:
    """viser asks for one as soon as any browser says so, and says it on its output."""
    bare = viser.ViserServer("127.0.0.1", 0, verbose=False)
    request = msgspec.msgpack.encode({"type": "ShareUrlDisconnect"})
    printed: list[str] = []

    def everything() -> str:
        printed.append(capfd.readouterr().out)
        return "".join(printed)

    try:
        for at in (f"127.0.0.1:{bare.get_port()}", address):
            with connect(f"ws://{at}", subprotocols=PROTOCOL) as page:
                page.recv(timeout=60.0)
                page.send(request)
                page.ping().wait(60.0)
            if at != address:
                until(everything, lambda text: "share URL" in text)  # in whatever pieces it comes
                printed.clear()
        assert "share URL" not in everything()
    finally:
        bare.stop()


@pytest.mark.parametrize("host", [None, "", "[", "evil.example", "127.0.0.1.evil.example"])
def test_no_name_and_a_broken_one_are_refused_with_the_names_that_count(host: str | None) -> None:
    assert "localhost" in objection(host, None, own_names("127.0.0.1"))


def test_a_page_that_other_machines_reach_is_not_served_unless_the_deployment_says_insecure(capsys):
    deployment = Deployment(panel=PanelSection(host="0.0.0.0"))
    assert run(deployment, None, line_logger("panel"), ShutdownRequest()) == 1
    assert "[panel] would listen on 0.0.0.0, beyond this machine, without TLS" in capsys.readouterr().err
