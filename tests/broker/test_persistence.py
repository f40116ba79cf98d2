"""Sessions and retained messages over a restart of either broker, where the deployment gives them a folder."""

from __future__ import annotations

import re
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.broker.running import BROKERS, RunningBroker, wait_until
from tests.disks import WAYS, refusing_disk

# mosquitto 2.0.11 frees its memory twice, and so ends, where a file has taken the place of its folder.
REFUSALS = [(name, way) for name in BROKERS for way in WAYS if (name, way) != ("mosquitto", "replaced by a file")]
COMPLAINT = {"embedded": "cannot be written", "mosquitto": "rror"}
PERSISTED = {"embedded": "embedded_broker.json", "mosquitto": "mosquitto.db"}


@pytest.fixture(scope="module", params=BROKERS)
def keeping(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningBroker]:
    folder = tmp_path_factory.mktemp(f"keeping-{request.param}")
    running = RunningBroker(request.param, folder, persistence_folder=folder / "kept").wait_ready()
    yield running
    running.stop()


@pytest.mark.parametrize("is_killed", [False, True], ids=["ended", "killed"])
def test_sessions_queues_and_retained_messages_outlive_a_restart(keeping, join, version, topic, is_killed):
    name = f"kept-{version}-{is_killed}"
    file = keeping.folder / "kept" / PERSISTED[keeping.name]
    absent, sender = join(keeping, name, keeps=True), join(keeping)
    absent.subscribe(f"{topic}/#")
    absent.close()
    sender.publish(f"{topic}/status", "retained", retain=True)
    for number in range(20):
        sender.publish(f"{topic}/queued", str(number))
    if is_killed:  # each writes within a second or so of a change
        wait_until(lambda: file.exists() and f"{topic}/queued".encode() in file.read_bytes())
        newest = file.stat().st_mtime_ns
        sender.publish(f"{topic}/other", "x", retain=True)
        wait_until(lambda: file.stat().st_mtime_ns != newest)
    keeping.restart(kill=is_killed)
    back = join(keeping, name, keeps=True)
    assert back.has_session
    expected = [(f"{topic}/status", "retained"), *((f"{topic}/queued", str(number)) for number in range(20))]
    assert [back.next() for _ in expected] == expected
    late = join(keeping)
    late.subscribe(f"{topic}/status")
    assert late.next() == (f"{topic}/status", "retained")
    sender = join(keeping)
    sender.publish(f"{topic}/status", "", retain=True)
    sender.publish(f"{topic}/other", "", retain=True)


def test_a_clean_session_leaves_nothing_over_a_restart(keeping, join, version, topic):
    name = f"clean-{version}"
    join(keeping, name).subscribe(topic)
    keeping.restart()
    assert not join(keeping, name, keeps=True).has_session


@pytest.mark.parametrize("name", BROKERS)
def test_without_a_folder_a_restart_forgets_all_and_nothing_is_written(tmp_path, join, topic, name):
    running = RunningBroker(name, tmp_path).wait_ready()
    written = {"broker.log", "run", "run/broker.ready", "run/broker.alive"}
    join(running, "kept", keeps=True).subscribe(topic)
    join(running).publish(topic, "retained", retain=True)
    running.restart()
    assert not join(running, "kept", keeps=True).has_session
    sender, late = join(running), join(running)
    late.subscribe(topic)
    assert late.hears(sender, topic)
    assert late.messages.empty()
    running.stop()
    found = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")}
    assert found - written <= ({"run/mosquitto.conf"} if name == "mosquitto" else set())


@pytest.mark.parametrize(("name", "way"), REFUSALS)
def test_a_disk_that_refuses_ends_nothing_and_once_it_takes_files_all_is_kept_again(tmp_path, join, topic, name, way):
    with refusing_disk(way, tmp_path / "disk") as disk:
        file = disk.folder / PERSISTED[name]
        running = RunningBroker(name, tmp_path / "own", persistence_folder=disk.folder).wait_ready()
        writer, reader = join(running), join(running)
        reader.subscribe(topic)
        disk.refuse()
        writer.publish(f"{topic}/large", bytes(10_000), retain=True)  # mosquitto sees no error within its buffer
        for number in range(3):
            writer.publish(topic, str(number), retain=True)
            assert reader.next() == (topic, str(number))
        wait_until(lambda: COMPLAINT[name] in running.output)
        writer.publish(topic, "meanwhile", retain=True)
        assert reader.next() == (topic, "meanwhile")
        disk.take()
        writer.publish(topic, "again", retain=True)
        wait_until(lambda: file.exists() and b"again" in content(file))
        if name == "embedded":
            assert running.output.count(COMPLAINT[name]) == 1
            wait_until(lambda: "is written again" in running.output)
        running.restart(kill=True)
        late = join(running)
        late.subscribe(topic)
        assert late.next() == (topic, "again")
        running.stop()


def content(file: Path) -> bytes:
    """Payloads are in base64 where the file is text."""
    text = file.read_bytes()
    return text + b"".join(b64decode(each) for each in re.findall(rb'"payload":"([^"]*)"', text))


def test_a_file_that_cannot_be_read_is_put_aside_and_said(tmp_path, join):
    kept = tmp_path / "kept"
    kept.mkdir()
    (kept / PERSISTED["embedded"]).write_text("half a fi")
    running = RunningBroker("embedded", tmp_path, persistence_folder=kept).wait_ready()
    join(running)
    assert "starting without sessions and retained messages" in running.stop()
    assert (kept / f"{PERSISTED['embedded']}.unreadable").read_text() == "half a fi"
