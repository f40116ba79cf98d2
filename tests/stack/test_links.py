"""A link that is cut or slow in the middle of a move: the arm stays within its limits, and the client hears of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.optional import need, need_root
from tests.stack.link_cases import CASES, Case
from tests.stack.links import Links

pytestmark = pytest.mark.alone

# All of them: sudo .venv/bin/python -m tests.stack.links
FEW = ("desk-cut-both-0.2s", "cell-cut-into-1s", "board-slow-300ms", "desk-cut-out-10s-attached")
CHOSEN = [case for case in CASES if case.name in FEW]


@pytest.fixture(scope="module")
def links(tmp_path_factory) -> Iterator[Links]:
    need("mosquitto")
    need_root("tests/stack/test_links.py", with_taps=True)
    with Links(tmp_path_factory.mktemp("links")) as made:
        yield made


@pytest.mark.parametrize("case", CHOSEN, ids=[case.name for case in CHOSEN])
def test_an_arm_whose_link_fails_keeps_to_its_limits_and_its_client_hears_how_it_ended(links: Links, case: Case):
    came = links.run(case)
    assert came.faults == (), came
    assert came.ready_after < float("inf"), links.logs()


def test_a_gateway_that_freezes_is_started_anew_without_a_hand_and_the_arm_does_not_move_by_itself(links, capsys):
    """By deploy/probe: 5 s of standing still, 2 s of certainty, 1 s of backoff."""
    ready, again, faults = links.frozen("cell", "stepper_gateway")
    with capsys.disabled():
        print(f" ready {ready:.1f} s after it froze", end="")
    assert faults == []
    assert again["again"] == "SUCCEEDED", again
    assert ready < float("inf"), links.logs()


def test_every_link_is_cut_in_both_ways_and_each_and_slowed():
    assert len({case.name for case in CASES}) == len(CASES) == 4 * 9 + 4 * 2 + 9
    assert len(CHOSEN) == len(FEW)
