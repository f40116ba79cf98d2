"""Several clients of one planner: each cancels its own plan, sees how all stand, and blocks nobody."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue

import pytest
from msgspec.structs import replace

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.planning import NamedGoal, PlanCancel, PlanCode, PlanPhase, PlanProgress, PlanRequest, PlanResponse
from gemelo.schemas.scene import SceneClear, SceneReplace, SceneRequest
from gemelo.schemas.topics import PLAN, PLAN_CANCEL, PLAN_PROGRESS, SCENE_EDIT
from gemelo.services.planner.main import run
from tests.planner.walled import WALLED, past_the_wall

PATIENCE = 60.0  # [s]
SHORT = PlanRequest(goal=NamedGoal(name="ready"), start=past_the_wall().start)


class Bus:
    """A planner, and as many clients as wanted."""

    def __init__(self, folder: Path) -> None:
        self.network, self.stop = MemoryNetwork(), ShutdownRequest()
        self.deployment = Deployment(paths=PathsSection(run=str(folder)))
        self._planner = threading.Thread(target=self._serve)
        self._planner.start()

    def client(self, name: str) -> Node:
        return Node(name, self.deployment, bus=MemoryBus(self.network), stop=ShutdownRequest())

    def close(self) -> None:
        self.stop.set()
        self._planner.join(PATIENCE)
        assert not self._planner.is_alive()

    def _serve(self) -> None:
        with Node("planner", self.deployment, bus=MemoryBus(self.network), stop=self.stop) as node:
            run(node, self.deployment)


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[Bus]:
    bus = Bus(tmp_path)
    try:
        yield bus
    finally:
        bus.close()


class Watcher:
    """A third who only looks on."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.heard: list[PlanProgress] = []
        node.subscribe(PLAN_PROGRESS, self.heard.append)

    def until(self, is_true: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_true():
            assert time.monotonic() < end
            self.node.wait(0.02)

    def sees_search_of(self, *request_ids: str) -> None:
        for request_id in request_ids:
            self.until(lambda wanted=request_id: (wanted, PlanPhase.SEARCH) in self.phases)

    @property
    def phases(self) -> set[tuple[str, PlanPhase]]:
        return {(each.request_id, each.phase) for each in self.heard}


@contextmanager
def asking(node: Node, request: PlanRequest, timeout: float = PATIENCE) -> Iterator[SimpleQueue[PlanResponse]]:
    """The plan's answer, which another thread waits for; None where there was none."""
    answers: SimpleQueue[PlanResponse | None] = SimpleQueue()

    def ask() -> None:
        try:
            answers.put(node.call(PLAN, request, timeout))
        except NoAnswer:
            answers.put(None)

    thread = threading.Thread(target=ask)
    thread.start()
    try:
        yield answers
    finally:
        thread.join(PATIENCE)


def cancel(node: Node, request_id: str) -> bool:
    return node.call(PLAN_CANCEL, PlanCancel(request_id=request_id), PATIENCE).found


def build_walls(node: Node) -> None:
    assert node.call(SCENE_EDIT, SceneRequest(edit=SceneReplace(scene=WALLED)), PATIENCE).accepted


def test_two_clients_plan_side_by_side_and_each_ends_its_own(bus: Bus) -> None:
    with bus.client("first") as first, bus.client("second") as second, bus.client("third") as third:
        watcher = Watcher(third)
        build_walls(third)
        with asking(first, past_the_wall("one")) as one, asking(second, past_the_wall("two")) as two:
            watcher.sees_search_of("one", "two")
            assert cancel(second, "two")
            assert two.get(timeout=PATIENCE).code is PlanCode.PREEMPTED
            third.wait(0.3)  # what was said before lies in the inbox
            heard = len(watcher.heard)
            watcher.until(lambda: len(watcher.heard) > heard + 3)
            assert {each.request_id for each in watcher.heard[heard:]} == {"one"}
            assert cancel(third, "one")
            response = one.get(timeout=PATIENCE)
        assert response.code is PlanCode.PREEMPTED
        assert response.planning_time > 0.1
        stands = [each.elapsed for each in watcher.heard if each.request_id == "one"]
        assert stands == sorted(stands)
        assert stands[0] > 0.1
        assert {each.allowed for each in watcher.heard} == {100.0}
        assert not cancel(first, "one")


def test_a_short_plan_is_not_spoken_of(bus: Bus) -> None:
    with bus.client("asker") as asker, bus.client("third") as third:
        asker.call(PLAN, replace(SHORT, request_id="starts the process"), PATIENCE)
        watcher = Watcher(third)
        assert asker.call(PLAN, replace(SHORT, request_id="short"), PATIENCE).code is PlanCode.SUCCESS
        third.wait(0.3)
        assert [each for each in watcher.heard if each.request_id == "short" and each.elapsed < 0.1] == []
        assert cancel(asker, "short") is False


def test_a_client_that_is_gone_leaves_a_plan_that_anyone_may_end(bus: Bus) -> None:
    with bus.client("third") as third:
        watcher = Watcher(third)
        build_walls(third)
        with bus.client("gone") as gone, asking(gone, past_the_wall(), timeout=0.2):
            pass
        watcher.sees_search_of("planner-1")
        assert cancel(third, "planner-1")
        third.call(SCENE_EDIT, SceneRequest(edit=SceneClear()), PATIENCE)
        assert third.call(PLAN, SHORT, PATIENCE).code is PlanCode.SUCCESS


def test_a_planner_that_ends_while_it_plans_keeps_nobody_waiting_for_ever(bus: Bus) -> None:
    with bus.client("asker") as asker, bus.client("third") as third:
        watcher = Watcher(third)
        build_walls(third)
        with asking(asker, past_the_wall("long"), timeout=2.0) as answer:
            watcher.sees_search_of("long")
            bus.close()
            assert answer.get(timeout=PATIENCE) is None
