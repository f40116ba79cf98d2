"""A refusal as data, as a script has it."""

from __future__ import annotations

import pytest

import gemelo
from gemelo.schemas.reasons import Reason, remedy, say


def test_a_plan_from_elsewhere_is_refused_with_the_joint_and_both_places():
    with gemelo.simulate("rm1") as arm:
        plan = arm.plan(named="left")
        arm.move(named="ready")
        with pytest.raises(gemelo.Refused) as refused:
            arm.execute(plan)
    reason = refused.value.reason
    assert isinstance(reason, Reason)
    assert reason.code == "goal.start.elsewhere"
    assert reason.values["joint"] in arm.joint_names
    start, present = reason.values["start"], reason.values["present"]
    assert isinstance(start, float)
    assert isinstance(present, float)
    assert reason.values["distance"] == pytest.approx(abs(start - present))
    assert reason.remedies == (remedy("plan_from_here"),)
    assert str(refused.value) == f"refused by stepper_gateway: {reason}"
    assert say(reason, "es").startswith(f"{reason.values['joint']}: el plan empieza en ")
