"""A recording says whose clock each stamp is of, and how far that clock is from the recorder's."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.libraries.recordings.census import Census, is_news
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.contents import contents_of
from gemelo.libraries.recordings.mcap_file import CLOCKS, McapFile
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.recordings.table import NODES
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Publisher
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.system import NodeInfo, NodeRecord, NodeStatistics, Parameter
from gemelo.schemas.topics import STATISTICS
from gemelo.tools.cli.recording.bag import information
from tests.runtime.support import hear, spinning
from tests.runtime.test_clock_offset import Skewed

RECORD = NodeRecord(node="planner", info=NodeInfo(host="brain"), clock_offset=5.0, clock_bound=0.001)


@pytest.mark.parametrize("ahead", [5.0, -5.0, 0.0])
def test_the_clock_of_every_node_is_in_its_record(tmp_path: Path, ahead: float) -> None:
    deployment = Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))
    network, records = MemoryNetwork(), []
    with (
        Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as planner,
        Node("logger", deployment, robot="rm1", bus=MemoryBus(network)) as logger,
        spinning(Skewed(ahead).on(planner)),
    ):
        Census(logger, records.append)
        assert hear(logger, lambda: records, 10.0)
    (record,) = records
    assert record.clock_offset is not None
    assert abs(record.clock_offset - ahead) <= record.clock_bound + 1e-3
    assert record.info.clock == 0  # the moment of the answer is nothing of the node


def test_names_that_nobody_has_hold_up_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stranger's statistics, or the last ones of a command: a recorder that waited for each would miss what comes."""
    monkeypatch.setattr(MemoryBus, "wait_served", lambda bus, key, timeout: pytest.fail(f"it waits for {key}"))
    deployment = Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))
    network, records, heard = MemoryNetwork(), [], []
    with Node("logger", deployment, robot="rm1", bus=MemoryBus(network)) as logger:
        Census(logger, records.append)
        logger.subscribe(STATISTICS, lambda message: heard.append(message.node))
        for number in range(50):
            nobody = Publisher(MemoryBus(network), STATISTICS, f"nobody_{number}")
            nobody.put(NodeStatistics(node=f"nobody_{number}"))
        assert hear(logger, lambda: "nobody_49" in heard)
        logger.wait(0.0)  # what the answers have left to do
    assert records == []


def test_a_node_that_was_started_again_is_asked_at_once_and_one_of_long_ago_makes_place(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("gemelo.libraries.recordings.census.MAX_NODES", 1)
    deployment = Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))
    network, records = MemoryNetwork(), []
    asked: list[tuple[str, int]] = []
    monkeypatch.setattr(Census, "ask", lambda census, one: asked.append((one.name, one.at)))
    with Node("logger", deployment, robot="rm1", bus=MemoryBus(network)) as logger:
        Census(logger, records.append)
        at, heard = 0, list[NodeStatistics]()
        logger.now, logger.monotonic = lambda: at, lambda: float(at)
        logger.subscribe(STATISTICS, heard.append)
        said = ((100, "planner", 1), (101, "planner", 1), (102, "planner", 2), (103, "cli-7", 3), (200, "cli-8", 4))
        for count, (now, node, started) in enumerate(said, 1):
            at = now
            Publisher(MemoryBus(network), STATISTICS, node).put(NodeStatistics(node=node, started=started))
            assert hear(logger, lambda count=count: len(heard) == count)
    assert asked == [("planner", 100), ("planner", 102), ("cli-8", 200)]


@pytest.mark.parametrize(
    ("after", "news"),
    [
        (RECORD, False),
        (replace(RECORD, stamp=7), False),
        (replace(RECORD, clock_offset=5.0015, clock_bound=0.001), False),  # both errors explain it
        (replace(RECORD, clock_offset=5.0025, clock_bound=0.001), True),  # it has drifted, or was set
        (replace(RECORD, clock_offset=None), True),
        (replace(RECORD, info=NodeInfo(host="brain", ready=True)), False),
        (replace(RECORD, info=NodeInfo(host="cell")), True),
        (replace(RECORD, parameters=(Parameter(name="x"),)), True),
    ],
)
def test_a_record_is_told_again_when_its_clock_has_moved_farther_than_errors_explain(after, news) -> None:
    assert is_news(RECORD, after) is news


def test_the_metadata_has_each_writers_host_and_clock_as_it_was_last(tmp_path: Path) -> None:
    file = McapFile(tmp_path / "a.mcap", {})
    other = replace(RECORD, node="camera", info=NodeInfo(host="cell"), clock_offset=None)
    file.write(Entry(NODES, each, 1) for each in (RECORD, other, replace(RECORD, clock_offset=6.0)))
    file.close()
    reader = RecordingReader(tmp_path / "a.mcap")
    list(reader.rows())
    clocks = {name: json.loads(text) for name, text in reader.metadata[CLOCKS].items()}
    assert clocks == {
        "planner": {"host": "brain", "offset": 6.0, "bound": 0.001},
        "camera": {"host": "cell", "offset": None, "bound": 0.001},
    }


def test_the_contents_name_the_writers_whose_clock_was_not_the_recorders(tmp_path: Path) -> None:
    file = McapFile(tmp_path / "a.mcap", {})
    near = replace(RECORD, node="logger", clock_offset=0.0005)
    file.write(Entry(NODES, each, 1) for each in (RECORD, near))
    file.close()
    contents = contents_of(tmp_path / "a.mcap")
    assert (contents.clocks["planner"].host, contents.clocks["planner"].offset) == ("brain", 5.0)
    said = information(contents)
    assert "clock     of planner on brain: +5000.0 ±1.0 ms from the recorder's" in said
    assert "of logger" not in said
