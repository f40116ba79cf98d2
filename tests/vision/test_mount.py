"""The calibrated pose of a camera: against the truth, beside the closed forms, and refused where it is undetermined."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.mount import fit_mount
from gemelo.libraries.vision.calibration.reprojection import Carrier
from gemelo.libraries.vision.calibration.touches import fit_touches, spread_points
from gemelo.libraries.vision.camera_model import of_field_of_view
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import apply, inverse, rigid
from gemelo.schemas.reasons import because
from gemelo.tools.bench.vision.mounting import (
    MountingTrial,
    closed_form,
    level_trial,
    looking,
    six_joint_trial,
    tool_error,
)

MODEL = of_field_of_view(np.radians(60.0), 640, 480)
NINE, ONE = TagBoard(), TagBoard(columns=1, rows=1)
HAND_EYE = (cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_TSAI, cv2.CALIB_HAND_EYE_HORAUD)


@pytest.fixture(scope="module")
def rm1() -> ArmDescription:
    return load_arm(project_root() / "urdf/rm1")


@pytest.mark.parametrize("carrier", list(Carrier))
def test_nine_tags_place_the_camera_within_half_a_millimetre(carrier: Carrier) -> None:
    trial = six_joint_trial(MODEL, carrier, NINE, 12, np.random.default_rng(1))
    fit = fit_mount(trial.views, MODEL, carrier)
    assert fit.is_accepted
    assert fit.outliers == ()
    assert tool_error(fit.parent_from_camera, trial.parent_from_camera, carrier) < 0.5
    assert fit.held_out < 0.0006


def test_with_one_tag_the_closed_form_is_off_by_millimetres_and_the_reprojection_is_not() -> None:
    trial = six_joint_trial(MODEL, Carrier.CAMERA, ONE, 15, np.random.default_rng(2))
    park = closed_form(trial, MODEL, Carrier.CAMERA, cv2.CALIB_HAND_EYE_PARK)
    assert park is not None
    assert tool_error(park, trial.parent_from_camera, Carrier.CAMERA) > 3.0
    ours = fit_mount(trial.views, MODEL, Carrier.CAMERA).parent_from_camera
    assert tool_error(ours, trial.parent_from_camera, Carrier.CAMERA) < 1.5


def test_an_arm_that_is_itself_off_costs_no_more_than_it_is_off() -> None:
    trial = six_joint_trial(MODEL, Carrier.BOARD, NINE, 15, np.random.default_rng(3), arm_error=1.0)
    fit = fit_mount(trial.views, MODEL, Carrier.BOARD)
    assert tool_error(fit.parent_from_camera, trial.parent_from_camera, Carrier.BOARD) < 1.2
    assert 0.0002 < fit.held_out < 0.003


def test_hand_eye_methods_fail_on_an_arm_that_cannot_tilt(rm1: ArmDescription) -> None:
    trial = level_trial(rm1, MODEL, ONE, 15, np.random.default_rng(0))
    for method in HAND_EYE:
        found = closed_form(trial, MODEL, Carrier.BOARD, method)
        assert found is None or tool_error(found, trial.parent_from_camera, Carrier.BOARD) > 30.0


def test_what_an_arm_that_cannot_tilt_leaves_open_is_refused_by_name(rm1: ArmDescription) -> None:
    trial = level_trial(rm1, MODEL, ONE, 15, np.random.default_rng(0))
    fit = fit_mount(trial.views, MODEL, Carrier.BOARD)
    assert not fit.is_accepted
    height = because("measure.advice.height")
    parts = {"parts": ("camera height",), "last": "board on link height"}
    assert fit.undetermined == (because("measure.undetermined.several", height, **parts),)


def test_with_the_height_given_it_is_determined(rm1: ArmDescription) -> None:
    trial = level_trial(rm1, MODEL, ONE, 15, np.random.default_rng(1))
    fit = fit_mount(trial.views, MODEL, Carrier.BOARD, height=-0.04)
    assert fit.is_accepted
    assert tool_error(fit.parent_from_camera, trial.parent_from_camera, Carrier.BOARD) < 1.0


def test_poses_that_never_turn_are_refused(rm1: ArmDescription) -> None:
    trial = six_joint_trial(MODEL, Carrier.BOARD, NINE, 8, np.random.default_rng(1), tilt=0.0)
    level = [dataclasses.replace(view, base_from_link=_unturned(view.base_from_link)) for view in trial.views]
    again = _seen_again(trial, [view.base_from_link for view in level])
    fit = fit_mount(again.views, MODEL, Carrier.BOARD)
    assert not fit.is_accepted
    assert because("measure.advice.poses") in [each.causes[0] for each in fit.undetermined]


def _unturned(pose: np.ndarray) -> np.ndarray:
    return rigid(np.array([2.2, 2.0, 0.1]), pose[:3, 3])


def _seen_again(trial: MountingTrial, poses: list[np.ndarray]) -> MountingTrial:
    random = np.random.default_rng(9)
    views = []
    for view, pose in zip(trial.views, poses, strict=True):
        placed = apply(inverse(trial.parent_from_camera) @ pose @ trial.carrier_from_board, view.sighting.points)
        pixels = MODEL.project(placed) + random.normal(0.0, 0.3, (len(placed), 2))
        views.append(
            dataclasses.replace(view, base_from_link=pose, sighting=Sighting(view.sighting.points, pixels, 0.3))
        )
    return MountingTrial(views, trial.parent_from_camera, trial.carrier_from_board)


def test_a_pose_whose_tag_was_seen_two_pixels_off_is_named_and_left_out() -> None:
    trial = six_joint_trial(MODEL, Carrier.CAMERA, NINE, 12, np.random.default_rng(4))
    wrong = trial.views[6].sighting
    views = list(trial.views)
    views[6] = dataclasses.replace(
        views[6], sighting=Sighting(wrong.points, wrong.pixels + np.array([3.0, -2.0]), wrong.sigma)
    )
    fit = fit_mount(views, MODEL, Carrier.CAMERA)
    assert fit.outliers == (6,)
    assert fit.errors[6] > 0.0012
    assert tool_error(fit.parent_from_camera, trial.parent_from_camera, Carrier.CAMERA) < 0.5


def test_too_few_poses_are_counted() -> None:
    trial = six_joint_trial(MODEL, Carrier.CAMERA, NINE, 3, np.random.default_rng(4))
    with pytest.raises(NotMeasured, match="3 poses show the board, at least 5 are needed"):
        fit_mount(trial.views, MODEL, Carrier.CAMERA)


TOUCHED = np.array([[x, y, 0.0] for x in (-0.09, 0.0, 0.09) for y in (-0.06, 0.0, 0.06)])


def touching(count: int, seed: int, off: dict[int, float] | None = None) -> tuple[float, tuple[int, ...], float]:
    """[mm] error of the camera, the outliers, and [m] held out, with touches that are 0.5 mm off."""
    random = np.random.default_rng(seed)
    camera = looking(np.array([0.55, -0.3, 0.5]), np.array([0.25, 0.0, 0.0]))
    base_from_board = rigid(np.array([0.0, 0.0, 0.4]), np.array([0.25, 0.02, 0.003]))
    points = np.vstack([TOUCHED, TOUCHED * 0.5])
    pixels = MODEL.project(apply(inverse(camera) @ base_from_board, points)) + random.normal(0.0, 0.1, (len(points), 2))
    chosen = TOUCHED[spread_points(list(TOUCHED), count)]
    touched = apply(base_from_board, chosen) + random.normal(0.0, 0.0005, chosen.shape)
    for index, far in (off or {}).items():
        touched[index, 0] += far
    fit = fit_touches(chosen, touched, Sighting(points, pixels), MODEL)
    return tool_error(fit.base_from_camera, camera, Carrier.BOARD), fit.outliers, fit.held_out


@pytest.mark.parametrize("count", [4, 6, 9])
def test_touches_of_a_printed_board_place_the_camera(count: int) -> None:
    errors = [touching(count, seed)[0] for seed in range(12)]
    assert np.median(errors) < 0.8


def test_a_touch_beside_its_point_is_named_and_left_out() -> None:
    error, outliers, held_out = touching(9, 3, {5: 0.008})
    assert outliers == (5,)
    assert error < 0.9
    assert held_out < 0.0015


def test_touches_that_lie_together_are_refused_by_name() -> None:
    near = TOUCHED[:4] * 0.02
    with pytest.raises(ValueError, match=r"the board's turn about the vertical cannot be determined.*corners"):
        fit_touches(near, near, Sighting(TOUCHED, TOUCHED[:, :2]), MODEL)
