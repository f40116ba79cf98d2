"""The real planner on a bus in memory, and what a recorder hears of it."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.topics import DESCRIPTION
from gemelo.services.state_publisher.main import describe
from gemelo.tools.replay.planner import PLANS, TOPICS
from tests.planner.planning_node import beside_a_planner

PATIENCE = 60.0  # [s]


@pytest.fixture
def planner(tmp_path: Path):
    with beside_a_planner(tmp_path, "person", ends_within=PATIENCE) as node:
        yield node


class Recorder:
    """Everything that a replay of the planner needs, as it comes."""

    def __init__(self, node: Node, path: Path) -> None:
        self.entries: list[Entry] = []
        self._node, self._path = node, path
        wanted = {topic.key for topic in TOPICS}
        for topic in (each for each in recorded_topics() if each.key in wanted):
            node.subscribe(topic, lambda said, topic=topic: self._keep(topic, said), own=True, batch=0.0)

    def _keep(self, topic, said) -> None:
        self.entries.append(Entry(topic, said, time.time_ns()))

    def answers(self) -> int:
        return sum(entry.topic.key == PLANS.key for entry in self.entries)

    def write(self) -> Path:
        self._path.unlink(missing_ok=True)
        file = McapFile(self._path, {"deployment": {"json": '{"robot": "urdf/rm1"}'}})
        arm = load_arm(project_root() / "urdf/rm1")
        file.write([Entry(DESCRIPTION, describe(arm), self.entries[0].arrival), *self.entries])
        file.close()
        return self._path
