"""A mistake in a goal is told once: on the tab while it is set, above the tabs once a plan of it was refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gemelo
from gemelo.services.panel.model.problems import problem_of
from tests.panel.memory_page import memory_page


def test_a_refusal_that_the_page_tells_is_not_told_by_the_tab_again(tmp_path: Path):
    nearest = gemelo.Target(joints={"brazo_joint": 0.5})
    refused, planned, farther = (
        gemelo.Refused(text, check="collision", subject="a / b", value=value, limit=0.004, nearest=nearest)
        for text, value in (("there, a with b", -0.0343), ("at the goal, a with b", -0.03432), ("farther", -0.04))
    )
    with memory_page("rm1", tmp_path) as page:
        page.draw(5)
        operator, [shown] = page.panel.operator, page.panel.pages()
        problem = problem_of(refused)
        operator.goal.goal = replace(operator.goal.goal, problem=problem, version=operator.goal.goal.version + 1)
        page.draw(2)
        assert "there, a with b" in shown.move.problem.content
        assert shown.move.nearest.visible
        operator.tell(problem_of(farther))
        page.draw(2)
        assert "there, a with b" in shown.move.problem.content
        operator.tell(problem_of(planned))
        page.draw(2)
        assert "at the goal, a with b" in shown.problem.content
        assert shown.nearest.visible
        assert shown.move.problem.content == ""
        assert not shown.move.nearest.visible
        operator.forget_problem()
        page.draw(2)
        assert "there, a with b" in shown.move.problem.content
        assert shown.problem.content == ""
