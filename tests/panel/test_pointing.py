"""The detected thing that a click into an image means."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.detections import Detection
from gemelo.services.panel.model.pointing import pointed_at

NEAR = 16.0
PIXELS = st.floats(0.0, 640.0)


def square(name: str, x: float, y: float, half: float = 20.0, turn: float = 0.0) -> Detection:
    corners = [
        (x + half * math.cos(turn + angle), y + half * math.sin(turn + angle))
        for angle in (0.0, math.pi / 2, math.pi, 3 * math.pi / 2)
    ]
    return Detection(name=name, corners=tuple(corners))


@given(PIXELS, PIXELS, st.floats(0.0, 6.3), st.floats(0.0, 6.3), st.floats(0.0, 1.0))
def test_every_place_within_an_outline_means_the_thing(x: float, y: float, turn: float, way: float, share: float):
    inside = 20.0 / math.sqrt(2.0) * 0.999 * share  # a circle within the square
    place = x + inside * math.cos(way), y + inside * math.sin(way)
    pointed = pointed_at([square("cup", x, y, turn=turn)], {"cup"}, place, 0.0)
    assert pointed.name == "cup"
    assert pointed.away == 0.0


@given(st.floats(0.0, 6.3), st.floats(0.0, 6.3), st.floats(20.01, 200.0))
def test_beside_it_counts_as_far_as_the_outline_is_near(turn: float, way: float, far: float):
    place = 320.0 + far * math.cos(way), 240.0 + far * math.sin(way)
    pointed = pointed_at([square("cup", 320.0, 240.0, turn=turn)], {"cup"}, place, NEAR)
    assert far - 20.0 - 1e-9 <= pointed.away <= far - 20.0 / math.sqrt(2.0) + 1e-9
    assert pointed.name == ("cup" if pointed.away <= NEAR else "")
    assert pointed.nearest == "cup"


def test_of_two_the_one_around_the_place_or_the_nearer_one_is_meant():
    items = [square("cup", 100.0, 100.0), square("bolt", 160.0, 100.0)]
    for x, meant in ((100.0, "cup"), (125.0, "cup"), (135.0, "bolt"), (160.0, "bolt")):
        assert pointed_at(items, {"cup", "bolt"}, (x, 100.0), NEAR).name == meant


def test_of_two_that_overlap_the_one_whose_middle_is_nearer_is_meant():
    items = [square("board", 100.0, 100.0, half=90.0), square("cup", 130.0, 100.0)]
    assert pointed_at(items, {"cup", "board"}, (125.0, 100.0), NEAR).name == "cup"
    assert pointed_at(items, {"cup", "board"}, (60.0, 100.0), NEAR).name == "board"


def test_a_thing_goes_before_a_tag_that_is_none_and_a_tag_alone_is_named():
    items = [square("tag 100", 100.0, 100.0), square("cup", 130.0, 100.0)]
    assert pointed_at(items, {"cup"}, (100.0, 100.0), NEAR).name == "cup"
    pointed = pointed_at(items, {"cup"}, (85.0, 100.0), NEAR)
    assert (pointed.name, pointed.other, pointed.nearest) == ("", "tag 100", "cup")


def test_on_nothing_the_nearest_thing_is_said_and_how_far():
    pointed = pointed_at([square("cup", 100.0, 100.0)], {"cup"}, (100.0, 220.0), NEAR)
    assert (pointed.name, pointed.nearest, pointed.away) == ("", "cup", pytest.approx(100.0))


@pytest.mark.parametrize("items", [(), (Detection(name="cup"),)])
def test_without_an_outline_nothing_is_meant(items: tuple[Detection, ...]):
    pointed = pointed_at(items, {"cup"}, (1.0, 1.0), NEAR)
    assert (pointed.name, pointed.other, pointed.away) == ("", "", math.inf)
