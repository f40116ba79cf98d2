"""`planner` again: every recorded question, in the scene and from the joint state of its answer, and every jog.

A plan depends on the clock only where its time ends a search. So the clock stands still here, and an answer that took a
good part of its allowed time is set aside: no other run would give it again.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from typing import Any

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.recordings.table import exchanges_of
from gemelo.schemas.planning import PlanCode, PlanInputs, PlanningTimes, PlanRequest, PlanResponse, SceneVersion
from gemelo.schemas.topics import JOG_INPUTS, PLAN, PLAN_INPUTS, PLANNED_PATH, SCENE
from gemelo.services.planner.core import LONGEST, Planner
from gemelo.tools.replay import planner_answers, planner_jog
from gemelo.tools.replay.comparison import Comparison
from gemelo.tools.replay.planner_answers import AnswersAgain
from gemelo.tools.replay.planner_jog import JogAgain
from gemelo.tools.replay.recorded import Heard, NotReplayable, Recorded
from gemelo.tools.replay.scenes import Scenes

PLANS = exchanges_of(PLAN)
TOPICS = tuple(dict.fromkeys((PLANS, PLAN_INPUTS, SCENE, PLANNED_PATH, *planner_answers.TOPICS, *planner_jog.TOPICS)))
PATIENT = 0.4  # of the time allowed: a search is ended after half of it at the earliest (`path/search.py`)
CLOCKS = "plans that took more than 40 % of their time: the clock may have ended a search"
UNPLANNED = "plans that were refused or cancelled before a process planned them"
UNANSWERED = "questions without an answer"
ENDED = (PlanCode.TIMED_OUT, PlanCode.PREEMPTED)


def replay(recorded: Recorded, comparison: Comparison) -> None:
    """Compares plans but for `planning_time` and `times`, each `planned_path`, all other answers, scenes and jogs."""
    arm = recorded.arm()
    scenes = Scenes(recorded, arm, Kinematics(arm))
    others = any(recorded.of(topic) for topic in (JOG_INPUTS, *planner_answers.EXCHANGES.values()))
    if recorded.of(PLANS) or not others:
        again = PlansAgain(recorded, comparison, arm, scenes)
        for exchange, inputs in again.pairs():
            if not again.hold(exchange, inputs):
                return
    AnswersAgain(recorded, comparison, arm, scenes).compare()
    if comparison.difference is None:
        JogAgain(recorded, comparison, arm, scenes).compare()


class PlansAgain:
    """The core of the planner, and the recorded plans that are made with it."""

    def __init__(self, recorded: Recorded, comparison: Comparison, arm: ArmDescription, scenes: Scenes) -> None:
        self.comparison = comparison
        self._recorded, self._scenes, self._arm = recorded, scenes, arm
        self._planner = Planner(arm)
        self._shown: SceneVersion | None = None
        recorded.require(SCENE)
        self._paths = recorded.of(PLANNED_PATH)
        self._put = [path.message.stamp for path in self._paths]

    def pairs(self) -> Iterator[tuple[Heard[Any], PlanInputs]]:
        """Each answer with what it was made from, which the planner publishes just before it.

        The numbers of a planner that was started again begin with 1.
        """
        waiting = (each.message for each in self._recorded.require(PLAN_INPUTS))
        number: int | None = None
        for exchange in self._recorded.require(PLANS):
            if exchange.message.failure is not None:
                self.comparison.aside[UNANSWERED] += 1
                continue
            inputs = next(waiting, None)
            asked = exchange.message.stamp - round(exchange.message.duration * 1e9)
            while inputs is not None and inputs.stamp < asked:  # of an answer that was lost with its planner or client
                number, inputs = inputs.number, next(waiting, None)
            is_lost = inputs is None or inputs.stamp > exchange.message.stamp
            if inputs is None or is_lost or (number is not None and inputs.number not in (1, number + 1)):
                raise NotReplayable(
                    f"{self._recorded.path}: {PLAN_INPUTS.key} of the plan at {exchange.at:.3f} s is missing (number "
                    f"{1 if number is None else number + 1}): an input was lost, or record_inputs was off; take "
                    "another recording"
                )
            if number is not None and inputs.number == 1:
                self._planner, self._shown = Planner(self._arm), None
            number = inputs.number
            yield exchange, inputs

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
        version = SceneVersion(version=inputs.scene_version, epoch=inputs.scene_epoch, jaws=inputs.jaws)
        if version != self._shown:
            self._planner.set_world(self._scenes.world(version, f"the plan at {exchange.at:.3f} s"))
            self._planner.prepare()
            self._shown = version


def _aside(request: PlanRequest, was: PlanResponse, inputs: PlanInputs) -> str:
    """Why a plan is not made again, or ""."""
    if not inputs.planned:
        return UNPLANNED
    return CLOCKS if was.code in ENDED or inputs.elapsed > PATIENT * request.allowed_time else ""


def _timeless(response: PlanResponse) -> PlanResponse:
    """Without what the clock on the wall has measured."""
    return replace(response, planning_time=0.0, times=PlanningTimes())
