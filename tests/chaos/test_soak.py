"""The judgement of a soak: slopes after the warm-up, and what grew although it should not."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.reasons import because
from gemelo.tools.chaos.soak import (
    EVERY,
    FEW,
    FEWEST,
    HOUR,
    STEEPEST,
    WARM_UP,
    Growth,
    ProcessSample,
    complaints,
    growth_of,
    text_of,
)

COUNT = int(HOUR / EVERY)


def samples(memory: Sequence[float], **at_the_end: int) -> list[ProcessSample]:
    """One every `EVERY` seconds, of a process that takes a tenth of a core; `at_the_end` of the last one."""
    counts = {"files": 7, "sockets": 3, "threads": 5}
    return [
        ProcessSample(
            at=EVERY * k,
            memory=each,
            resident=2.0 * each,
            cpu=0.1 * EVERY * k,
            **(counts | (at_the_end if k == len(memory) - 1 else {})),
        )
        for k, each in enumerate(memory)
    ]


def grown(**fields: float) -> Growth:
    usual = {"cpu_percent": 1.0, "memory": 80.0, "memory_slope": 0.0, "files": 0, "sockets": 0, "threads": 0}
    return Growth(process="planner", **{**usual, **fields})


@given(st.floats(-50.0, 50.0), st.floats(10.0, 900.0))
def test_the_slope_of_a_line_is_its_slope_whatever_the_warm_up_was(slope: float, start: float):
    warming = int(WARM_UP * COUNT)
    memory = [start + (500.0 if k < warming else slope * EVERY * k / HOUR) for k in range(COUNT)]
    growth = growth_of("planner", samples(memory))
    assert growth.memory_slope == pytest.approx(slope, abs=1e-6)
    assert growth.cpu_percent == pytest.approx(10.0)
    assert growth.memory == memory[-1]


def test_files_sockets_and_threads_are_counted_from_the_end_of_the_warm_up():
    growth = growth_of("planner", samples([80.0] * COUNT, files=19, sockets=2, threads=5))
    assert (growth.files, growth.sockets, growth.threads) == (12, -1, 0)


def test_one_sample_has_no_slope():
    assert growth_of("planner", samples([80.0])).memory_slope == 0.0


def test_only_what_grows_beyond_its_limit_is_complained_of():
    assert complaints(grown(memory_slope=STEEPEST, files=FEW, sockets=FEW, threads=FEW), COUNT) == []
    assert complaints(grown(memory_slope=-20.0, files=-9), COUNT) == []
    (slope,) = complaints(grown(memory_slope=1.26), COUNT)
    assert slope == because("soak.memory", process="planner", slope=1.26, limit=STEEPEST)
    assert str(slope) == "planner: +1.3 MB/h of memory, limit 1"
    more = complaints(grown(files=5, sockets=6, threads=7), COUNT)
    assert [(why.code, why.values["more"]) for why in more] == [("soak.more", 5), ("soak.more", 6), ("soak.more", 7)]
    assert [str(why) for why in more] == ["planner: +5 files", "planner: +6 sockets", "planner: +7 threads"]
    table = text_of([grown(memory_slope=1.26)], 9, [slope]).splitlines()
    assert table[0].split() == ["process", "CPU", "[%]", "memory", "[MB]", "[MB/h]", "files", "sockets", "threads"]
    assert table[2].split() == ["planner", "1.0", "80", "+1.26", "+0", "+0", "+0"]
    assert table[-2:] == ["9 moves; 1 complaints", "planner: +1.3 MB/h of memory, limit 1"]


def test_a_slope_of_few_samples_is_no_complaint():
    enough = round(FEWEST / (1.0 - WARM_UP)) + 1
    assert complaints(grown(memory_slope=9.0), enough)
    assert complaints(grown(memory_slope=9.0), enough - 2) == []
