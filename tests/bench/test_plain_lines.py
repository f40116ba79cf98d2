"""The reference of straight tool lines."""

from __future__ import annotations

import numpy as np
import pytest

from gemelo.services.planner.core import Planner
from gemelo.tools.bench.planner.tool_motion import STEP, PlainLines, line_requests
from gemelo.tools.bench.scenes import parol6, rm1


@pytest.mark.parametrize("arm", [rm1(), parol6()], ids=lambda arm: arm.name)
def test_the_plain_way_is_on_the_line_as_far_as_it_goes(arm):
    planner, plain = Planner(arm), PlainLines(arm)
    whole = 0
    for request in line_requests(arm, planner)[:10]:
        rows = plain.rows(request)
        places = np.array([planner.kinematics.tool(row).position for row in rows])
        start, goal = places[0], np.array(request.goal.position)
        away = np.linalg.norm(np.cross(places - start, goal - start), axis=1) / np.linalg.norm(goal - start)
        assert away.max() < 1e-4
        assert np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0.0) <= STEP + 1e-4
        whole += bool(np.linalg.norm(places[-1] - goal) < 1e-4)
    assert whole >= 4
