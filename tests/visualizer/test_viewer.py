"""The viewer as a process: ready when it answers, on loopback only, and gone when it is told to go."""

import contextlib
import http.client
import ipaddress
import os
import re
import signal
import socket
import subprocess
import sys
import time

import psutil
import pytest
import rerun as rr

from gemelo.schemas.deployment import ViewerMode, ViewerSection
from gemelo.services.visualizer.program.rerun_program import environment, free_port, rerun_binary
from gemelo.services.visualizer.program.viewer_connection import ViewerConnection
from gemelo.services.visualizer.viewer import CUT_OFF, address, command, resolved


class Viewer:
    """A gemelo-viewer with its own ports and run folder."""

    def __init__(self, run, mode="web"):
        self.run = run
        self.section = ViewerSection(mode=ViewerMode(mode), port=free_port(), web_port=free_port())
        self.process = None

    def start(self):
        environment = {
            **os.environ, "GEMELO_PATHS_RUN": str(self.run), "GEMELO_VIEWER_MODE": self.section.mode.value,
            "GEMELO_VIEWER_PORT": str(self.section.port), "GEMELO_VIEWER_WEB_PORT": str(self.section.web_port),
        }  # fmt: skip
        self.process = subprocess.Popen(
            [sys.executable, "-m", "gemelo.services.visualizer.viewer"],
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        return self.process

    def wait_until_ready(self, timeout=60.0):
        deadline = time.monotonic() + timeout
        while not (self.run / "viewer.ready").exists():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < deadline, "not ready"
            time.sleep(0.05)

    def children(self):
        return psutil.Process(self.process.pid).children(recursive=True)

    def end(self):
        if self.process is not None:
            self.process.kill()
            self.process.communicate()


@pytest.fixture
def viewer(tmp_path):
    viewer = Viewer(tmp_path / "run")
    yield viewer
    viewer.end()


@pytest.fixture
def idle_viewer(tmp_path):
    viewer = Viewer(tmp_path / "run", mode="none")
    yield viewer
    viewer.end()


def answers(port):
    with socket.socket() as probe:
        probe.settimeout(0.3)
        return probe.connect_ex(("127.0.0.1", port)) == 0


def gone(processes, timeout=60.0):
    return not psutil.wait_procs(processes, timeout=timeout)[1]


def test_it_gets_ready_listens_on_loopback_only_and_stops_without_orphans(viewer):
    viewer.start()
    viewer.wait_until_ready()
    children = viewer.children()
    itself = psutil.Process(viewer.process.pid)
    assert listening(itself) == {("127.0.0.1", viewer.section.port), ("127.0.0.1", viewer.section.web_port)}
    assert all(ipaddress.ip_address(host).is_loopback for child in children for host, _ in listening(child))
    time.sleep(1.2)
    began = time.monotonic()
    viewer.process.send_signal(signal.SIGTERM)
    output, _ = viewer.process.communicate(timeout=60.0)
    assert output.count("viewer: ") == 1
    assert time.monotonic() - began < 5.0
    assert viewer.process.returncode == 0
    assert gone(children)
    assert f"http://127.0.0.1:{viewer.section.web_port}/?url=" in output
    assert not (viewer.run / "viewer.ready").exists()


def listening(process):
    """The addresses that it listens on."""
    found = process.net_connections("inet")
    return {(each.laddr.ip, each.laddr.port) for each in found if each.status == psutil.CONN_LISTEN}


def status(address, host, path="/", origin=None):
    """The status of an answer, and the origin whose pages may read it."""
    connection = http.client.HTTPConnection(*address, timeout=10.0)
    headers = {"Host": host, "Content-Type": "application/grpc-web+proto", "X-Grpc-Web": "1"}
    with contextlib.closing(connection):
        connection.request("POST", path, b"", headers if origin is None else {**headers, "Origin": origin})
        answer = connection.getresponse()
        return answer.status, answer.getheader("Access-Control-Allow-Origin")


def test_a_name_that_a_site_has_pointed_here_reads_nothing_of_the_twin(viewer):
    """Rerun answers it, which is why its ports are not the program's own; a page of another name it leaves unread."""
    viewer.start()
    viewer.wait_until_ready()
    data, page = ("127.0.0.1", viewer.section.port), ("127.0.0.1", viewer.section.web_port)
    messages = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages"
    own = [address for child in viewer.children() for address in listening(child)]
    assert sorted(status(address, "rebound.example", messages)[0] for address in own) == [200, 404]  # data, page
    assert status(data, "rebound.example", messages)[0] == 403
    assert status(page, "rebound.example")[0] == 403
    assert status(data, f"127.0.0.1:{viewer.section.port}", messages)[0] == 200
    assert status(page, f"localhost:{viewer.section.web_port}")[0] == 200
    own_page = f"http://127.0.0.1:{viewer.section.web_port}"
    assert status(data, "127.0.0.1", messages, own_page) == (200, own_page)
    assert status(data, "127.0.0.1", messages, "http://rebound.example:9090")[1] is None


def stream_to(viewer):
    stream = rr.RecordingStream("gemelo", recording_id="late")
    stream.connect_grpc(f"rerun+http://127.0.0.1:{viewer.section.port}/proxy")
    return stream


@pytest.mark.full
def test_a_viewer_that_is_opened_late_gets_the_newest_first(viewer, tmp_path):
    """As a page does that is opened after hours: it shows the arm as it is, and then fills in the past."""
    viewer.start()
    viewer.wait_until_ready()
    stream, saved = stream_to(viewer), tmp_path / "late.rrd"
    for second in range(100):
        columns = rr.Scalars.columns(scalars=[float(second)])
        rr.send_columns(f"sent/{second}", [rr.TimeColumn("time", duration=[float(second)])], columns, recording=stream)
        stream.flush(timeout_sec=5.0)
    late = subprocess.Popen(
        [rerun_binary(), f"rerun+http://127.0.0.1:{viewer.section.port}/proxy", "--save", saved],
        env=environment(os.environ), stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        deadline = time.monotonic() + 60.0
        order = []
        while len(order) < 100:
            assert time.monotonic() < deadline, order
            time.sleep(0.2)
            order = arrived(saved)
    finally:
        late.kill()
        late.wait()
        stream.disconnect()
    assert order[0] == 99
    assert order.index(98) < order.index(1)


def arrived(saved):
    """The seconds that are in the file, in their order."""
    done = subprocess.run([rerun_binary(), "rrd", "print", saved], capture_output=True, text=True)
    return [int(second) for second in re.findall(r"/sent/(\d+)\b", done.stdout)]


SENDER = """
import sys, rerun as rr
stream = rr.RecordingStream("gemelo")
stream.connect_grpc(sys.argv[1])
for number in range(10_000_000):
    stream.log("a", rr.Scalars(number))
    if number == 20_000:
        print("on", flush=True)
"""


@pytest.mark.full
def test_a_sender_that_is_killed_is_said_in_words_without_the_protocols_own(viewer):
    viewer.start()
    viewer.wait_until_ready()
    url = f"rerun+http://127.0.0.1:{viewer.section.port}/proxy"
    sender = subprocess.Popen([sys.executable, "-c", SENDER, url], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        assert sender.stdout.readline() == b"on\n"
    finally:
        sender.kill()
        sender.communicate()
    said = viewer.process.stderr.readline()
    assert said == f"{CUT_OFF}\n"


@pytest.mark.full
def test_kill_9_of_the_parent_leaves_no_orphan(viewer):
    viewer.start()
    viewer.wait_until_ready()
    children = viewer.children()
    assert children
    viewer.process.kill()
    viewer.process.communicate()
    assert gone(children)


@pytest.mark.full
def test_it_ends_with_an_error_when_the_program_dies(viewer):
    viewer.start()
    viewer.wait_until_ready()
    viewer.children()[0].kill()
    _, errors = viewer.process.communicate(timeout=60.0)
    assert viewer.process.returncode == 1
    assert "the rerun program ended with code -9" in errors


def test_a_taken_port_is_named_with_its_remedy(viewer):
    with socket.create_server(("127.0.0.1", viewer.section.web_port)):
        viewer.start()
        _, errors = viewer.process.communicate(timeout=60.0)
    assert viewer.process.returncode == 1
    assert f"port {viewer.section.web_port} on 127.0.0.1 is taken" in errors
    assert "GEMELO_VIEWER_WEB_PORT" in errors


def test_without_a_viewer_it_idles_ready(idle_viewer):
    idle_viewer.start()
    idle_viewer.wait_until_ready()
    assert idle_viewer.children() == []
    idle_viewer.process.send_signal(signal.SIGTERM)
    assert idle_viewer.process.wait(60.0) == 0


@pytest.mark.parametrize(
    ("mode", "environment", "expected"),
    [
        ("auto", {}, "web"), ("auto", {"DISPLAY": ":0"}, "native"), ("auto", {"WAYLAND_DISPLAY": "w"}, "native"),
        ("web", {"DISPLAY": ":0"}, "web"), ("none", {}, "none"),
    ],
)  # fmt: skip
def test_auto_is_native_where_there_is_a_display(mode, environment, expected):
    assert resolved(ViewerMode(mode), environment, "linux").value == expected


def test_the_program_is_always_bound_and_limited(tmp_path):
    for mode in (ViewerMode.WEB, ViewerMode.NATIVE):
        line = " ".join(command(tmp_path / "rerun", ViewerSection(), mode, "1GB"))
        assert "--bind 127.0.0.1 --port 9876" in line
        assert "memory-limit 1GB" in line
        assert "server-memory-limit 16MB" in line
    assert "window" in address(ViewerSection(), ViewerMode.NATIVE)


def test_the_watch_sees_the_end_and_the_return_of_a_viewer():
    watch = ViewerConnection("127.0.0.1", free_port())
    assert not watch.is_new(0.0)
    assert not watch.is_alive
    with socket.create_server(("127.0.0.1", watch.port)) as server:
        assert not watch.is_new(0.5)
        assert watch.is_new(1.0)
        peer, _ = server.accept()
        assert all(watch.is_alive for _ in range(5))
        peer.close()
        deadline = time.monotonic() + 2.0
        while watch.is_alive and time.monotonic() < deadline:
            time.sleep(0.01)
        assert not watch.is_alive
        assert watch.is_new(2.0)
        watch.close()
