"""The seed's stepping, and how much of a move arrives by it and by ours."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gemelo.firmware.platform.host.sketch import AustinStepper
from gemelo.tools.bench.old_dialects import RelativeMove, pulses, relative_moves, seed_move_percent


def end_of(stepper: AustinStepper, messages: list[RelativeMove], until: float = 30.0) -> int:
    return sum(direction for _, direction in pulses(stepper, messages, until))


def test_a_move_that_is_sent_once_arrives_whole():
    assert end_of(AustinStepper(4665.6, 3110.0), [RelativeMove(0.0, 4665)]) == 4665
    assert end_of(AustinStepper(4665.6, 3110.0), [RelativeMove(0.0, -4665)]) == -4665


def test_a_ramp_takes_as_long_as_its_acceleration_says():
    times = [time for time, _ in pulses(AustinStepper(1000.0, 500.0), [RelativeMove(0.0, 4000)], 60.0)]
    assert times[-1] == pytest.approx(4000 / 1000 + 1000 / 500, rel=0.03)
    assert min(b - a for a, b in pairwise(times)) == pytest.approx(1 / 1000, rel=1e-6)


def test_a_message_throws_away_what_is_left_of_the_last_one():
    assert end_of(AustinStepper(4665.6, 3110.0), relative_moves(4665, 0.1, 5.0)) == pytest.approx(48, abs=2)
    assert end_of(AustinStepper(100.0, 100.0), relative_moves(100, 0.1, 5.0)) == pytest.approx(4, abs=1)


def test_a_90_degree_move_arrives_whole_where_the_seed_lost_97_percent_and_more():
    figure = seed_move_percent()
    assert figure.median == 100.0
    assert figure.met
    assert sorted(figure.reference) == ["seed: antebrazo_joint", "seed: brazo_joint"]
    assert all(0.5 < share < 5.0 for share in figure.reference.values())
