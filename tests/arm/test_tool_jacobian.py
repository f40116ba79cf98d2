"""The tool's place and Jacobian in plain Python are those of pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.tool_jacobian import ToolJacobian
from gemelo.libraries.arm.model.description import load_arm
from tests.profiles import examples

ROOT = Path(__file__).parents[2]
ARMS = {name: load_arm(ROOT / "urdf" / name) for name in ("rm1", "parol6")}
BOTH = {name: (Kinematics(arm), ToolJacobian(arm)) for name, arm in ARMS.items()}


@pytest.mark.parametrize("name", ARMS)
@examples(quick=10, full=40)
@given(data=st.data())
def test_the_tool_and_its_jacobian_are_those_of_pinocchio(name: str, data: st.DataObject) -> None:
    at = [data.draw(st.floats(joint.lower, joint.upper)) for joint in ARMS[name].joints]
    truth, plain = BOTH[name]
    assert plain.tool(at) == pytest.approx(truth.tool(at).position, abs=1e-9)
    assert pytest.approx(truth.jacobian(at)[:3], abs=1e-9) == np.array(plain.columns(at)).T
