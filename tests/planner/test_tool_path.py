"""The tool's way as geometry: straight, round, and round its corners."""

import math
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import FramePose
from gemelo.services.planner.cartesian.arcs import arc_about, arc_through
from gemelo.services.planner.cartesian.tool_path import ToolPath, polyline
from gemelo.services.planner.path.path_curve import NO_LENGTH, CubicSpline, rounded_runs
from gemelo.services.planner.request.refusals import PlanRefused
from tests.profiles import examples

NUMBERS = st.floats(-1.0, 1.0).map(lambda value: round(value, 4))
POINTS = st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array)
POSES = st.tuples(POINTS, POINTS).map(lambda pair: FramePose(pair[0], pin.exp3(2.0 * pair[1])))


def place(*numbers: float) -> FramePose:
    return FramePose(np.array(numbers), np.eye(3))


def turn_between(first: FramePose, second: FramePose) -> np.ndarray:
    return pin.log3(second.rotation @ first.rotation.T)


@given(POSES, POSES)
def test_a_line_ends_where_it_should_and_turns_evenly(start: FramePose, end: FramePose):
    paths = polyline([start, end], 0.0)
    if not paths:
        assert np.linalg.norm(end.position - start.position) <= NO_LENGTH
        return
    path = paths[0]
    assert path.at(path.length).position == pytest.approx(end.position, abs=1e-12)
    assert path.at(path.length).rotation == pytest.approx(end.rotation, abs=1e-9)
    third = path.at(path.length / 3.0)
    assert third.position == pytest.approx(start.position + (end.position - start.position) / 3.0, abs=1e-12)
    if np.linalg.norm(turn_between(start, end)) < 3.1:  # at half a turn both ways are as short
        assert turn_between(start, third) == pytest.approx(turn_between(start, end) / 3.0, abs=1e-9)


@examples(quick=20, full=60)
@given(st.lists(POSES, min_size=3, max_size=5), st.floats(1e-3, 0.3))
def test_a_blended_corner_is_cut_within_its_radius_and_has_no_kink(poses: list[FramePose], blend: float):
    paths = polyline(poses, blend)
    assume(len(paths) == 1)
    path = paths[0]
    ends = [0.0, *path.marks, path.length]
    corners = [pose.position for pose in poses]
    for low, high in pairwise(ends):
        positions = [path.at(along).position for along in np.linspace(low, high, 9)]
        assert max(distance_to_polyline(position, corners) for position in positions) <= blend + 1e-9
    for mark in path.marks:
        assert derivatives(path, mark, -1) == pytest.approx(derivatives(path, mark, 1), abs=2e-3)
    assert path.at(path.length).position == pytest.approx(corners[-1], abs=1e-9)


def derivatives(path: ToolPath, mark: float, side: int, step: float = 1e-6) -> np.ndarray:
    """Of position and turn, one-sided; the turn from where it is at the mark."""
    here, there = path.at(mark), path.at(min(max(mark + side * step, 0.0), path.length))
    return side * np.concatenate((there.position - here.position, turn_between(here, there))) / step


def distance_to_polyline(point: np.ndarray, corners: list[np.ndarray]) -> float:
    return min(distance_to_leg(point, *leg) for leg in pairwise(corners))


def distance_to_leg(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    way = end - start
    square = float(way @ way)
    share = 0.0 if square == 0.0 else min(1.0, max(0.0, float((point - start) @ way) / square))
    return float(np.linalg.norm(point - start - share * way))


def test_without_a_blend_every_corner_is_a_stop():
    poses = [place(0, 0, 0), place(1, 0, 0), place(1, 1, 0), place(1, 1, 0), place(0, 1, 0)]
    assert [path.length for path in polyline(poses, 0.0)] == pytest.approx([1.0, 1.0, 1.0])
    assert len(polyline(poses, 0.1)) == 1
    assert polyline([place(0, 0, 0)] * 3, 0.1) == []


@examples(quick=15, full=40)
@given(POSES, POINTS, POSES)
def test_an_arc_keeps_its_radius_and_passes_its_point(start: FramePose, interim: np.ndarray, end: FramePose):
    try:
        arc = arc_through(start, interim, end)
    except PlanRefused as refused:
        assume(refused.refusal.check != "arc")
        raise
    radius = np.linalg.norm(start.position - arc.centre)
    positions = np.array([arc.at(along).position for along in np.linspace(0.0, arc.length, 100)])
    assert np.linalg.norm(positions - arc.centre, axis=1) == pytest.approx(np.full(100, radius), rel=1e-9)
    assert np.linalg.norm(positions - interim, axis=1).min() <= arc.metres / 100
    assert arc.at(arc.length).position == pytest.approx(end.position, abs=1e-9 * max(1.0, radius**2))
    assert arc.at(arc.length).rotation == pytest.approx(end.rotation, abs=1e-9)


@given(st.floats(0.05, 3.0), POINTS, POINTS, st.floats(-5e-5, 5e-5))
def test_an_arc_about_a_centre_is_the_shorter_one(angle: float, centre: np.ndarray, axis: np.ndarray, off: float):
    if np.linalg.norm(axis) < 0.1:
        return
    normal = axis / np.linalg.norm(axis)
    spoke = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    start = FramePose(centre + spoke, np.eye(3))
    end = FramePose(centre + pin.exp3(angle * normal) @ spoke * (1.0 + off), np.eye(3))
    arc = arc_about(start, centre, end)
    assert arc.angle == pytest.approx(angle, abs=1e-3)
    assert np.linalg.norm(arc.centre - centre) < 2e-4 / math.sin(0.5 * angle)
    assert arc.at(arc.length).position == pytest.approx(end.position, abs=1e-9)


@pytest.mark.parametrize(
    ("interim", "end", "subject"),
    [
        ((0.5, 0.0, 0.0), (1.0, 0.0, 0.0), "interim"),
        ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), "goal"),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "interim"),
        ((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), "interim"),
        ((1e9, 0.0, 0.0), (1.0, 0.0, 0.0), "interim"),
    ],
)
def test_points_that_make_no_arc_are_refused(interim, end, subject):
    with pytest.raises(PlanRefused) as refused:
        arc_through(place(0, 0, 0), np.array(interim), place(*end))
    assert refused.value.refusal.subject == subject
    assert refused.value.refusal.remedy


def test_a_centre_that_is_nearer_to_one_end_is_refused_with_the_difference():
    with pytest.raises(PlanRefused, match=r"1 m from the start and 1\.5 m from the goal") as refused:
        arc_about(place(1, 0, 0), np.zeros(3), place(0, 1.5, 0))
    assert (refused.value.refusal.value, refused.value.refusal.limit) == (pytest.approx(0.5), 1e-4)
    with pytest.raises(PlanRefused, match="many arcs"):
        arc_about(place(1, 0, 0), np.zeros(3), place(-1, 0, 0))


def test_a_spline_is_exact_for_cubics_and_smooth_for_all_else():
    knots = np.cumsum([0.0, 0.1, 0.2, 0.05, 0.3, 0.1])
    spline = CubicSpline(knots, (knots**3 - 2.0 * knots)[:, None])
    along = np.linspace(0.0, knots[-1], 50)
    value, first, second, third = spline.at(along)
    assert value[:, 0] == pytest.approx(along**3 - 2.0 * along, abs=1e-12)
    assert first[:, 0] == pytest.approx(3.0 * along**2 - 2.0, abs=1e-11)
    assert second[:, 0] == pytest.approx(6.0 * along, abs=1e-9)
    assert third[:, 0] == pytest.approx(np.full(50, 6.0), abs=1e-7)
    rough = CubicSpline(knots, np.random.default_rng(1).normal(size=(6, 2)))
    before, after = rough.at(knots[1:-1] - 1e-9), rough.at(knots[1:-1] + 1e-9)
    for left, right, tolerance in zip(before[:3], after[:3], (1e-6, 1e-4, 1e-2), strict=True):
        assert left == pytest.approx(right, abs=tolerance)


@examples(quick=15, full=40)
@given(st.lists(POINTS, min_size=2, max_size=5), st.floats(0.001, 0.2))
@example([np.zeros(3), np.array((0.0, 1.0, 0.0)), np.array((1.0, 0.0, 0.0))], 2.0**-9)  # cut within 1 % of a leg
def test_joint_corners_are_cut_within_what_the_arm_may_move(corners: list[np.ndarray], blend: float):
    configurations, reach = np.array(corners), np.array((0.5, 0.3, 1.0))
    for run in rounded_runs(configurations, np.array((2.0, 1.0, 0.1)), reach, blend):
        along = np.concatenate([np.linspace(low, high, 50) for low, high in pairwise(run.knots)])
        value, first, _, _ = run.at(along)
        scaled = [corner * reach for corner in corners]
        assert max(distance_to_polyline(row * reach, scaled) for row in value) <= blend + 1e-9
        steps = np.diff(along)
        wide = steps > 1e-9  # between narrower ones a difference has no digits left
        chords = np.diff(value, axis=0)[wide] / steps[wide, None]
        assert np.abs(chords - 0.5 * (first[1:] + first[:-1])[wide]).max() < 0.01
