"""A sample of the ledger's calibration: what it calls 95 % sure has lost no step in 95 % of the cases."""

from __future__ import annotations

import pytest

from gemelo.tools.bench.ledger import LEVEL, POPULATIONS, SEED, StateAfterMove, simulate, text_of

MOVES = 150


@pytest.mark.full
@pytest.mark.parametrize("name", ["log-normal about 0.6", "log-uniform 0.1 to 1.2", "1.2 times beta (2, 3)"])
def test_of_all_states_that_it_calls_sure_95_percent_have_lost_no_step(name: str) -> None:
    seen = simulate(MOVES, POPULATIONS[name], SEED)
    sure = [one for one in seen if one.confidence >= LEVEL]
    assert len(sure) >= MOVES // 10
    assert sum(not one.is_lost for one in sure) >= LEVEL * len(sure)
    doubted = [one for one in seen if one.confidence < 0.5]
    assert any(one.is_lost for one in doubted)  # weak motors do lose steps here
    assert sum(one.is_lost for one in doubted) / len(doubted) > sum(one.is_lost for one in sure) / len(sure)


def test_every_state_stands_in_one_row_of_the_table() -> None:
    rows = text_of([StateAfterMove(c, False) for c in (0.0, 0.5, 0.79, 0.8, 0.9, 0.95, 0.99, 1.0)]).splitlines()[2:-2]
    assert [row.split()[3] for row in rows] == ["1", "2", "1", "1", "1", "2"]
