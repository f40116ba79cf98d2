"""Named states of an imported arm: within its limits, also as the text of robot.srdf and robot.toml."""

from __future__ import annotations

from itertools import islice

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.robot_import.poses import states_around

LIMIT = st.floats(-6.3, 6.3)


@given(LIMIT, st.floats(0.01, 12.0), st.floats(0.0, 1.0))
def test_a_state_is_within_the_limits_as_text_too(lower: float, travel: float, share: float) -> None:
    low, high = np.array([lower]), np.array([lower + travel])
    for state in islice(states_around(low + share * travel, low, high), 0, None, 100):
        assert lower < float(f"{state[0]:.9g}") < lower + travel
