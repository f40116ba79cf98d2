"""The cause of an error of pointing, by its pattern over the table."""

from __future__ import annotations

import numpy as np
import pytest

from gemelo.libraries.vision.calibration.accuracy import Budget, Cause, judge

BUDGET = Budget(camera=0.0001, mount=0.0004, arm=0.0008)
TAGS = np.array([[0.26, 0.16], [0.30, -0.12], [0.22, -0.2], [0.14, -0.32], [0.4, 0.02], [0.2, 0.3]])


def noise(size: float, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, size, TAGS.shape)


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    return angle * np.column_stack([-points[:, 1], points[:, 0]])


CODES = {
    Cause.NONE: "well", Cause.MOUNT: "mount", Cause.SCALE: "scale", Cause.ZERO: "zero", Cause.ARM: "arm",
    Cause.UNKNOWN: "unknown",
}  # fmt: skip


@pytest.mark.parametrize(
    ("offsets", "cause"),
    [
        (noise(0.0004), Cause.NONE),
        (noise(0.0004) + np.array([0.006, -0.003]), Cause.MOUNT),
        (noise(0.0004) + turned(TAGS - TAGS.mean(axis=0), 0.03), Cause.MOUNT),
        (noise(0.0004) + 0.03 * (TAGS - TAGS.mean(axis=0)), Cause.SCALE),
        (noise(0.0004) + turned(TAGS, 0.03), Cause.ZERO),
        (noise(0.005), Cause.ARM),
        (noise(0.0004) + np.array([0.004, 0.0]) + 0.025 * (TAGS - TAGS.mean(axis=0)), Cause.UNKNOWN),
    ],
)
def test_each_cause_has_its_pattern(offsets, cause):
    found = judge(TAGS, offsets, BUDGET)
    assert found.cause is cause, found
    assert found.why.code == f"measure.pointing.{CODES[cause]}"
    assert found.why.values["off"] == pytest.approx(1e3 * found.worst)


def test_one_tag_says_how_much_and_not_why():
    found = judge(TAGS[:1], np.array([[0.005, 0.0]]), BUDGET)
    assert found.cause is Cause.UNKNOWN
    assert found.shift == pytest.approx(0.005)
    assert judge(TAGS[:1], np.array([[0.0005, 0.0]]), BUDGET).cause is Cause.NONE


def test_tags_at_one_place_say_nothing_of_turn_and_scale():
    found = judge(np.array([[0.2, 0.1]] * 3), np.array([[0.004, 0.0], [0.004, 0.0], [0.004, 0.0]]), BUDGET)
    assert (found.turn, found.scale) == (0.0, 0.0)
    assert found.cause is Cause.MOUNT


@pytest.mark.parametrize("seed", range(20))
def test_a_camera_beside_its_place_is_found_whatever_the_noise(seed):
    random = np.random.default_rng(seed)
    direction = random.uniform(-np.pi, np.pi)
    offsets = noise(0.0005, seed) + 0.005 * np.array([np.cos(direction), np.sin(direction)])
    assert judge(TAGS, offsets, BUDGET).cause is Cause.MOUNT
