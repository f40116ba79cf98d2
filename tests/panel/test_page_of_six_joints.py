"""The page of parol6: six sliders, and a gizmo that turns as well."""

from __future__ import annotations

from math import degrees

import pytest

import gemelo
from tests.panel.person import Person, until


@pytest.fixture(scope="module")
def robot() -> str:
    return "parol6"


def test_sliders_a_plan_and_execute_bring_six_joints_there(person: Person, arm: gemelo.Arm) -> None:
    first, last = arm.joint_names[0], arm.joint_names[-1]
    person.types(f"{first} [°]", 20)
    person.types(f"{last} [°]", 200)
    person.press("Plan and execute")
    until(lambda: degrees(arm.joints[first]), lambda now: abs(now - 20.0) < 0.1)
    until(lambda: degrees(arm.joints[last]), lambda now: abs(now - 200.0) < 0.1)
    person.reads("Arrived")
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9
    person.tab("Jog")
    assert person.button("rz +").count() == 1
