"""Plans that are cancelled: while they are searched for, while they wait, twice, too late, and where nobody listens."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, SimpleQueue

import pytest
from msgspec.structs import replace

from gemelo.schemas.planning import NamedGoal, PlanCode, PlanPhase, PlanRequest, PlanResponse
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.workers.pending_plan import LONGEST_ID, MOST_PLANS
from gemelo.services.planner.workers.workers import MOST, Workers
from tests.planner.processes import planning_processes
from tests.planner.walled import WALLED, past_the_wall

PROJECT = Path(__file__).parents[2]
SHORT = PlanRequest(goal=NamedGoal(name="ready"), start=past_the_wall().start)
PATIENCE = 60.0  # [s]


class Desk:
    """Workers, and their answers by request id."""

    def __init__(self) -> None:
        self.scene = WALLED
        self.workers = Workers(PROJECT / "urdf/rm1", PROJECT, lambda: (None, 0.0), lambda: self.scene)
        self._answers: dict[str, SimpleQueue[PlanResponse]] = {}

    def ask(self, request: PlanRequest) -> None:
        answers = self._answers.setdefault(request.request_id, SimpleQueue())
        self.workers.plan(request, answers.put)

    def answer(self, request_id: str) -> PlanResponse:
        return self._answers[request_id].get(timeout=PATIENCE)

    def preempted(self, request_id: str) -> str:
        """The sentence of a plan that was cancelled."""
        response = self.answer(request_id)
        assert response.code is PlanCode.PREEMPTED
        assert response.refusal is not None
        assert response.refusal.subject == request_id
        assert response.trajectory.points == ()
        with pytest.raises(Empty):
            self._answers[request_id].get(timeout=0.1)
        return response.refusal.message

    def phases(self) -> dict[str, PlanPhase]:
        return {each.request_id: each.phase for each in self.workers.progress(now=0)}

    def until(self, is_true: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_true():
            assert time.monotonic() < end
            time.sleep(0.02)

    def search(self, request_id: str, planner_id: str = "") -> None:
        """Asks for what is never found, and waits until it is searched for."""
        self.ask(past_the_wall(request_id, planner_id))
        self.until(lambda: self.phases().get(request_id) is PlanPhase.SEARCH)


@pytest.fixture
def desk() -> Iterator[Desk]:
    desk = Desk()
    try:
        yield desk
    finally:
        desk.workers.close()
        assert planning_processes() == []


@pytest.mark.parametrize("planner_id", ["", "RRTConnect", "RRTstar", "BITstar", "PRM"])
def test_a_search_stops_when_it_is_cancelled_and_its_process_goes_on(desk: Desk, planner_id: str):
    desk.search("long", planner_id)
    before = planning_processes()
    cancelled = desk.workers.cancel("long")
    assert cancelled.found
    assert cancelled.message.startswith('the plan "long" is cancelled after ')
    sentence = desk.preempted("long")
    assert sentence.startswith("the plan was cancelled after ")
    assert sentence.endswith(" s, while searching")
    desk.ask(replace(SHORT, request_id="next"))
    assert desk.answer("next").refusal is not None  # the walls are in the way of this one too
    assert planning_processes() == before


def test_a_process_that_does_not_heed_it_is_killed_and_replaced(desk: Desk):
    desk.search("long")
    (process,) = planning_processes()
    process.suspend()
    assert desk.workers.cancel("long").found
    assert desk.preempted("long").endswith("while searching")
    desk.scene = PlanningScene()
    desk.ask(replace(SHORT, request_id="next"))
    assert desk.answer("next").code is PlanCode.SUCCESS
    assert not process.is_running()


def test_a_plan_that_waits_for_a_process_is_cancelled_at_once(desk: Desk):
    for number in range(MOST):
        desk.search(f"long {number}")
    desk.ask(past_the_wall("waiting"))
    desk.until(lambda: "waiting" in desk.phases())
    assert desk.phases() == {"long 0": PlanPhase.SEARCH, "long 1": PlanPhase.SEARCH, "waiting": PlanPhase.WAITING}
    assert desk.workers.cancel("waiting").found
    assert desk.preempted("waiting").endswith("while waiting")
    assert set(desk.phases()) == {"long 0", "long 1"}
    for number in range(MOST):
        assert desk.workers.cancel(f"long {number}").found
        assert desk.preempted(f"long {number}").endswith("while searching")


def test_a_plan_is_cancelled_while_its_process_starts_which_is_then_there_for_the_next(desk: Desk):
    (process,) = planning_processes()
    desk.ask(past_the_wall("early"))
    assert desk.workers.cancel("early").found
    assert desk.preempted("early").endswith("while waiting")
    desk.ask(replace(SHORT, request_id="next"))
    desk.answer("next")
    assert planning_processes() == [process]


def test_a_second_cancel_changes_nothing(desk: Desk):
    desk.search("long")
    assert desk.workers.cancel("long").found
    desk.workers.cancel("long")
    desk.preempted("long")
    assert desk.workers.cancel("long").message == 'there is no plan "long": it has ended, or never began'


def test_a_cancel_after_the_end_finds_nothing_and_the_id_is_free_again(desk: Desk):
    desk.scene = PlanningScene()
    for _ in range(2):
        desk.ask(replace(SHORT, request_id="short"))
        assert desk.answer("short").code is PlanCode.SUCCESS
        assert not desk.workers.cancel("short").found


def test_a_cancel_without_an_id_is_no_cancel_of_all(desk: Desk):
    desk.search("long")
    answer = desk.workers.cancel("")
    assert not answer.found
    assert answer.message.startswith("request_id is empty")
    assert desk.phases() == {"long": PlanPhase.SEARCH}


def test_an_id_that_is_in_use_or_endless_is_refused(desk: Desk):
    desk.search("long")
    second: SimpleQueue[PlanResponse] = SimpleQueue()
    desk.workers.plan(past_the_wall("long"), second.put)
    desk.workers.plan(past_the_wall("x" * (LONGEST_ID + 1)), second.put)
    for said in ('a plan "long" is being made already', f"request_id has {LONGEST_ID + 1} characters"):
        response = second.get(timeout=PATIENCE)
        assert response.code is PlanCode.INVALID_GOAL_CONSTRAINTS
        assert response.refusal is not None
        assert response.refusal.message.startswith(said)
    assert desk.phases() == {"long": PlanPhase.SEARCH}


def test_a_flood_of_plans_is_turned_away_and_leaves_nothing_behind(desk: Desk):
    refused: SimpleQueue[PlanResponse] = SimpleQueue()
    for number in range(MOST_PLANS):
        desk.ask(past_the_wall(f"{number}"))
    desk.workers.plan(past_the_wall("too much"), refused.put)
    response = refused.get(timeout=PATIENCE)
    assert response.refusal is not None
    assert response.refusal.message == f"{MOST_PLANS} plans are waiting already"
    for number in reversed(range(MOST_PLANS)):
        assert desk.workers.cancel(f"{number}").found
    assert {desk.answer(f"{number}").code for number in range(MOST_PLANS)} == {PlanCode.PREEMPTED}
    assert desk.phases() == {}


def test_plans_without_an_id_are_told_apart_by_ids_of_the_planners_own(desk: Desk):
    for _ in range(2):
        desk.ask(past_the_wall())
    desk.until(lambda: len(desk.phases()) == 2)
    assert set(desk.phases()) == {"planner-1", "planner-2"}
    assert desk.workers.cancel("planner-2").found
    assert desk.answer("").code is PlanCode.PREEMPTED


def test_a_plan_that_has_to_be_stopped_says_what_it_was_at(desk: Desk):
    desk.search("long")
    desk.workers.cancel("long")
    desk.preempted("long")
    (process,) = planning_processes()
    process.suspend()
    desk.ask(past_the_wall("late", allowed=0.2))
    response = desk.answer("late")
    assert response.code is PlanCode.TIMED_OUT
    assert response.refusal is not None
    assert response.refusal.message.endswith("while waiting: 0.2 s were allowed")
    assert response.refusal.limit == 0.2
