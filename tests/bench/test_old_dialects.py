"""The bench's figures of the old dialects."""

from __future__ import annotations

from gemelo.tools.bench import old_dialects, ra_remainder


def test_no_step_remains_of_random_messages(monkeypatch) -> None:
    monkeypatch.setattr(ra_remainder, "MESSAGES", 500)
    monkeypatch.setattr(ra_remainder, "MESSAGE_TIMES", (2.0,))
    figure = ra_remainder.ra_remainder_steps()
    assert figure.met
    assert "20 to 250 us" in figure.note


def test_a_line_and_its_answer_take_at_least_what_their_baud_rate_makes_them_take(monkeypatch) -> None:
    monkeypatch.setattr(old_dialects, "LINES", 8)
    figure = old_dialects.text_link_ms()
    assert figure.median is not None
    assert figure.median >= 1e3 * 40 * 10 / 115_200
    assert figure.reference == {"published": 29.8}
