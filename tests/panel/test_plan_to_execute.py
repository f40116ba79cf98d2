"""Execute stands out while there is a plan that the arm has not gone along: not before, and not after it."""

from __future__ import annotations

import gemelo
from gemelo.services.panel.model.motions import Motions
from gemelo.services.panel.model.problems import Problem


def test_a_plan_is_to_be_executed_until_the_arm_goes_along_it() -> None:
    told: list[Problem] = []
    with gemelo.simulate("rm1") as arm:
        motions = Motions(arm, told.append)
        assert not motions.has_plan_to_execute
        assert motions.make({"named": "left"}) is not None
        assert motions.has_plan_to_execute
        assert motions.execute() is not None
        assert motions.plan is not None, "it is still shown"
        assert not motions.has_plan_to_execute
        motions.ask()
        assert motions.has_plan_to_execute, "one is being made"
        motions.make_asked(lambda: {"named": "ready"})
        assert motions.has_plan_to_execute
        motions.forget_plan()
        assert not motions.has_plan_to_execute
    assert told == []
