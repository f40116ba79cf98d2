"""Figures that are read from the pins of the real firmware core."""

import pytest

from gemelo.firmware.bindings.frames import PinChange
from gemelo.tools.bench import pulses
from gemelo.tools.bench.figures import NotMeasured
from gemelo.tools.bench.probe import Pulse, WireKnot, pulses_of


def test_pulses_are_counted_by_dir():
    changes = [PinChange(3, 1, 1), PinChange(4, 0, 1), PinChange(9, 0, 0), PinChange(11, 1, 0), PinChange(12, 3, 0)]
    assert pulses_of(changes, 0) == [Pulse(3, 1), Pulse(11, 0)]
    assert pulses_of(changes, 1, inverted=True) == [Pulse(12, 1)]


@pytest.mark.parametrize(("rate", "is_exact"), [(24_950, True), (25_100, False)])
def test_a_rate_of_more_than_a_pulse_in_two_ticks_is_not_exact(rate, is_exact):
    assert pulses.is_exact(rate, 50_000) is is_exact


def test_a_crossing_is_found_where_the_path_is():
    a, b = WireKnot((0,), (0,)), WireKnot((2560,), (128_000,))
    time = pulses.crossing(a, b, 0, 3.5)
    assert pulses.hermite(a, b, 0, time / pulses.DT) == pytest.approx(3.5, abs=1e-3)


def test_the_last_rise_is_not_the_last_fall():
    assert pulses.last_rise([PinChange(5, 1, 0), PinChange(6, 0, 0), PinChange(8, 2, 0)]) == 8
    assert pulses.last_rise([PinChange(5, 1, 0), PinChange(6, 0, 0)]) == 5


def test_an_estop_is_silent_within_one_tick(monkeypatch):
    monkeypatch.setattr(pulses, "PRESSES", 200)
    figure = pulses.estop_reaction_ticks()
    assert figure.met
    assert figure.reference["most"] <= 1


def test_a_press_that_does_nothing_is_no_figure(monkeypatch):
    monkeypatch.setattr(pulses.CoreDevice, "press_input", lambda *_: None)
    monkeypatch.setattr(pulses, "PRESSES", 1)
    with pytest.raises(NotMeasured, match="after the e-stop"):
        pulses.estop_reaction_ticks()
