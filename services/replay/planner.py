"""`planner` again: every recorded question to `plan`, in the scene and from the joint state that it was planned from.

A plan depends on the clock only where its time ends a search. So the clock stands still here, and an answer that took a
good part of its allowed time is set aside: no other run would give it again.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from schemas.planning import PlanCode, PlanInputs, PlanningTimes, PlanRequest, PlanResponse
from schemas.scene import PlanningScene, SceneObject
from schemas.topics import PLAN, PLAN_INPUTS, PLANNED_PATH, SCENE
from services.planner.collision.scene_shapes import SceneError
from services.planner.collision.world import World
from services.planner.core import LONGEST, Planner
from services.recordings.table import exchanges_of
from services.replay.comparison import Comparison
from services.replay.recorded import Heard, NotReplayable, Recorded
from services.runtime.deployment import project_root

PLANS = exchanges_of(PLAN)
TOPICS = (PLANS, PLAN_INPUTS, SCENE, PLANNED_PATH)
PATIENT = 0.4  # of the time allowed: a search is ended after half of it at the earliest (`path/search.py`)
CLOCKS = "plans that took more than 40 % of their time: the clock may have ended a search"
UNPLANNED = "plans that were refused or cancelled before a process planned them"
UNANSWERED = "questions without an answer"
ENDED = (PlanCode.TIMED_OUT, PlanCode.PREEMPTED)

SceneKey = tuple[int, int, tuple[SceneObject, ...]]  # version, epoch, jaws


def replay(recorded: Recorded, comparison: Comparison) -> None:
    """Compares each answer but for `planning_time` and `times`, and the `planned_path` that is published with it."""
    again = PlansAgain(recorded, comparison)
    for exchange, inputs in again.pairs():
        if not again.hold(exchange, inputs):
            break


class PlansAgain:
    """The core of the planner, and the recorded plans that are made with it."""

    def __init__(self, recorded: Recorded, comparison: Comparison) -> None:
        self.comparison = comparison
        self._recorded = recorded
        self._planner = Planner(recorded.arm())
        self._shown: SceneKey | None = None
        scenes = [each.message for each in recorded.require(SCENE)]
        self._scenes = {(scene.version, scene.epoch): scene for scene in scenes}
        self._paths = recorded.of(PLANNED_PATH)
        self._put = [path.message.stamp for path in self._paths]

    def pairs(self) -> Iterator[tuple[Heard[Any], PlanInputs]]:
        """Each answer with what it was made from, which the planner publishes just before it."""
        waiting = iter(self._recorded.require(PLAN_INPUTS))
        number: int | None = None
        for exchange in self._recorded.require(PLANS):
            if exchange.message.failure is not None:
                self.comparison.aside[UNANSWERED] += 1
                continue
            inputs = next(waiting, None)
            lost = inputs is None or inputs.message.stamp > exchange.message.stamp
            if inputs is None or lost or (number is not None and inputs.message.number != number + 1):
                raise NotReplayable(
                    f"{self._recorded.path}: {PLAN_INPUTS.key} of the plan at {exchange.at:.3f} s is missing (number "
                    f"{1 if number is None else number + 1}): an input was lost; take another recording"
                )
            number = inputs.message.number
            yield exchange, inputs.message

    def hold(self, exchange: Heard[Any], inputs: PlanInputs) -> bool:
        """True if the plan is the same again, or is set aside."""
        request: PlanRequest = exchange.message.question
        was: PlanResponse = exchange.message.answer
        aside = _aside(request, was, inputs)
        if aside:
            self.comparison.aside[aside] += 1
            return True
        self._show(exchange, inputs)
        is_allowed = 0.0 < request.allowed_time <= LONGEST
        asked = replace(request, allowed_time=LONGEST) if is_allowed else request
        now = self._planner.plan(asked, inputs.present, inputs.age)
        if not self.comparison.hold(PLANS.key, exchange, _timeless(was), _timeless(now)):
            return False
        return was.code is not PlanCode.SUCCESS or self._hold_path(exchange, now)

    def _hold_path(self, exchange: Heard[Any], now: PlanResponse) -> bool:
        """The newest path before the answer is this plan's: both come from one thread."""
        place = bisect_right(self._put, exchange.message.stamp) - 1
        if place < 0:
            raise NotReplayable(
                f"{self._recorded.path}: {PLANNED_PATH.key} of the plan at {exchange.at:.3f} s is missing; record it"
                " too"
            )
        path = self._paths[place]
        again = self._planner.planned_path(now.trajectory, path.message.stamp)
        return self.comparison.hold(PLANNED_PATH.key, path, path.message, again)

    def _show(self, exchange: Heard[Any], inputs: PlanInputs) -> None:
        """Gives the planner the scene that it had, with the jaws as they stood."""
        key = (inputs.scene_version, inputs.scene_epoch, inputs.jaws)
        if key == self._shown:
            return
        scene = self._scenes.get(key[:2])
        if scene is None:
            raise NotReplayable(
                f"{self._recorded.path}: version {key[0]} of the scene, in which the plan at {exchange.at:.3f} s was "
                "made, is not in it; record from the planner's start, or `scene` too"
            )
        self._planner.set_world(self._world(replace(scene, objects=(*scene.objects, *inputs.jaws))))
        self._planner.prepare()
        self._shown = key

    def _world(self, scene: PlanningScene) -> World:
        arm = self._planner.arm
        try:
            return World(arm, self._planner.kinematics, scene, (project_root(), arm.folder))
        except (SceneError, ValueError) as error:
            raise NotReplayable(
                f"{self._recorded.path}: version {scene.version} of the scene cannot be built here: {error}; put the "
                "mesh where it was"
            ) from error


def _aside(request: PlanRequest, was: PlanResponse, inputs: PlanInputs) -> str:
    """Why a plan is not made again, or ""."""
    if not inputs.planned:
        return UNPLANNED
    return CLOCKS if was.code in ENDED or inputs.elapsed > PATIENT * request.allowed_time else ""


def _timeless(response: PlanResponse) -> PlanResponse:
    """Without what the clock on the wall has measured."""
    return replace(response, planning_time=0.0, times=PlanningTimes())
