"""The time that an arm stands between two legs, from what the device says of the path that it has played."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.device import DeviceState
from gemelo.tools.bench.figures import NotMeasured
from gemelo.tools.bench.program_legs import standing_between

PERIOD = 0.02  # [s] between two states


def states(legs: list[float], pauses: list[float], is_one_stream: bool) -> list[DeviceState]:
    """What a device says that plays `legs` [s], standing between them for `pauses` [s]."""
    found, now, before = [], 0.0, 5.0  # it has played 5 s of stream 6 earlier
    spans = [(leg, pause) for leg, pause in zip(legs, [*pauses, 1.0], strict=True)]
    begins, begun = [], 0.3
    for leg, pause in spans:
        begins.append(begun)
        begun += leg + pause
    while now < begun:
        index = sum(now >= begin for begin in begins) - 1
        if index < 0:
            stream, played = 6, before
        else:
            inside = min(now - begins[index], legs[index])
            stream = 7 if is_one_stream else 7 + index
            played = inside + (sum(legs[:index]) if is_one_stream else 0.0)
        found.append(DeviceState(stamp=round(now * 1e9), stream=stream, play_time=played))
        now += PERIOD
    return found


@given(st.lists(st.floats(0.5, 2.0), min_size=2, max_size=5), st.data(), st.booleans())
def test_every_pause_is_found_whether_streams_change_or_not(
    legs: list[float], data: st.DataObject, is_one_stream: bool
) -> None:
    least = 0.0 if is_one_stream else PERIOD  # a stream follows another only when the device has said that it rests
    pauses = data.draw(st.lists(st.floats(least, 0.3), min_size=len(legs) - 1, max_size=len(legs) - 1))
    found = standing_between(states(legs, pauses, is_one_stream), legs)
    assert found == pytest.approx([pause * 1e3 for pause in pauses], abs=0.01)


def test_legs_that_were_not_played_are_no_figure() -> None:
    with pytest.raises(NotMeasured, match="not all legs were played"):
        standing_between(states([1.0], [], True), [1.0, 1.0])
