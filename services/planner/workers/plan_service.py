"""Plans on the bus: `plan`, its cancel, how those stand that take longer, and the way that was planned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from msgspec.structs import replace

from gemelo.libraries.runtime.bus.wire import TooLarge, encoded
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.server import Pending
from gemelo.schemas.planning import (
    PlanCancel,
    PlanCancelResult,
    PlanCode,
    PlanInputs,
    PlanProgress,
    PlanRequest,
    PlanResponse,
)
from gemelo.schemas.topics import PLAN, PLAN_CANCEL, PLAN_INPUTS, PLAN_PROGRESS, PLANNED_PATH
from gemelo.services.planner.core import Planner
from gemelo.services.planner.request.refusals import too_large
from gemelo.services.planner.scene.scene_keeper import SceneKeeper
from gemelo.services.planner.workers.pending_plan import Answer, OnInputs


class PlanMaker(Protocol):
    """Makes plans: in processes of their own, or in this one."""

    @property
    def are_ready(self) -> bool:
        """True if a plan need not wait for a process to start."""
        ...

    def plan(self, request: PlanRequest, answer: Answer, on_inputs: OnInputs = ...) -> None: ...

    def cancel(self, request_id: str) -> PlanCancelResult: ...

    def progress(self, now: int) -> list[PlanProgress]:
        """Of every plan that is no short one; `now` [ns] UNIX."""
        ...

    def close(self) -> None: ...


def sendable(response: PlanResponse) -> PlanResponse:
    """The response, or a refusal where it is too large: a path that nobody is given is not shown either."""
    try:
        encoded(response)
    except TooLarge as error:
        return too_large(error.size, error.limit)
    return response


class PlanService:
    """Hands requests to the workers and their answers back, all in the node's thread of logic."""

    def __init__(
        self, node: Node, workers: PlanMaker, planner: Planner, keeper: SceneKeeper, is_recorded: Callable[[], bool]
    ) -> None:
        """`is_recorded` says if what answers were made from is published."""
        self._is_recorded = is_recorded
        self._node, self._workers, self._planner, self._keeper = node, workers, planner, keeper
        self._path, self._progress = node.publisher(PLANNED_PATH), node.publisher(PLAN_PROGRESS)
        self._inputs, self._answers = node.publisher(PLAN_INPUTS), 0
        node.serve_later(PLAN, self._plan)
        node.serve(PLAN_CANCEL, self._cancel)

    def step(self, now: int) -> None:
        """Says how plans stand; `now` [ns] UNIX."""
        for progress in self._workers.progress(now):
            self._progress.put(progress)

    def _plan(self, request: PlanRequest, pending: Pending[PlanResponse]) -> None:
        began = self._node.monotonic()
        inputs = [PlanInputs()]

        def answer(response: PlanResponse) -> None:
            self._node.post(lambda: self._answer(response, pending, began, inputs[-1]))

        self._workers.plan(request, answer, inputs.append)

    def _cancel(self, request: PlanCancel) -> PlanCancelResult:
        return self._workers.cancel(request.request_id)

    def _answer(self, response: PlanResponse, pending: Pending[PlanResponse], began: float, inputs: PlanInputs) -> None:
        response = sendable(response)
        if response.code is PlanCode.SUCCESS:
            self._path.put(self._planner.planned_path(response.trajectory, self._node.now()))
        elif response.refusal is not None:
            self._node.log.info(f"refused: {response.refusal.message}")
        self._keeper.show_refusal(response)
        self._answers += 1
        if self._is_recorded():
            self._inputs.put(replace(inputs, stamp=self._node.now(), number=self._answers))
        pending.reply(replace(response, planning_time=self._node.monotonic() - began))
