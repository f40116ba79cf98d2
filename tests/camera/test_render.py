"""The virtual camera's image against OpenCV's own projection, its depth buffer, its optics, and its tags."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, from_rpy
from gemelo.schemas.camera import CameraInfo
from gemelo.services.camera.virtual.render import Optics, render
from gemelo.services.camera.virtual.solids import Face, PosedSolid, box, cylinder, sphere, tag

EXACT = Optics(samples=3, blur=0.0, noise=0.0, background=(0, 0, 0))
BARREL = (-0.28, 0.09, 0.0012, -0.0009, -0.01)
DOWN = (1.0, 0.0, 0.0, 0.0)  # x of the image along x of the base, looking down
WHITE = (255, 255, 255)


def camera(distortion: tuple[float, ...] = ()) -> CameraInfo:
    return CameraInfo(
        name="test", width=640, height=480, intrinsics=(554.3, 0, 325.2, 0, 551.1, 236.4, 0, 0, 1),
        distortion=distortion,
    )  # fmt: skip


def projected(points: np.ndarray, info: CameraInfo, pose: Rigid) -> np.ndarray:
    """(n, 2) [px] by cv2.projectPoints; `points` (n, 3) [m] in the base."""
    x, y, z, w = pose[1]
    turn = np.zeros((3, 3))
    for column, axis in enumerate(np.eye(3)):
        t = 2.0 * np.cross((x, y, z), axis)
        turn[:, column] = axis + w * t + np.cross((x, y, z), t)
    vector, _ = cv2.Rodrigues(turn.T)
    matrix = np.array(info.intrinsics).reshape(3, 3)
    distortion = np.array(info.distortion or (0.0,) * 5)
    return cv2.projectPoints(points, vector, -turn.T @ np.array(pose[0]), matrix, distortion)[0].reshape(-1, 2)


def plate(centre: tuple[float, float, float], side: float, level: int = 255) -> PosedSolid:
    """A flat square that faces upwards."""
    h = side / 2.0
    corners = np.array([[-h, -h, 0.0], [h, -h, 0.0], [h, h, 0.0], [-h, h, 0.0]])
    return PosedSolid((Face(corners, texture=np.full((1, 1), level, np.uint8)),), (centre, IDENTITY[1]))


def centroids(image: np.ndarray, near: np.ndarray, reach: int = 8) -> np.ndarray:
    """(n, 2) [px] the centre of the light around each of `near`."""
    found = []
    for u, v in near:
        left, top = round(u) - reach, round(v) - reach
        patch = image[top : top + 2 * reach + 1, left : left + 2 * reach + 1, 0].astype(float)
        rows, columns = np.mgrid[: patch.shape[0], : patch.shape[1]]
        found.append((left + (patch * columns).sum() / patch.sum(), top + (patch * rows).sum() / patch.sum()))
    return np.array(found)


@pytest.mark.parametrize("distortion", [(), BARREL, (0.3, -0.2, 0.0, 0.002, 0.0)])
def test_a_point_is_where_opencv_projects_it_to_a_twentieth_of_a_pixel(distortion: tuple[float, ...]) -> None:
    pose: Rigid = ((0.03, -0.02, 0.6), from_rpy(np.pi + 0.25, 0.15, 0.4))
    info = camera(distortion)
    points = np.array([[x, y, 0.0] for x in np.linspace(-0.5, 0.5, 15) for y in np.linspace(-0.5, 0.5, 15)])
    where = projected(points, info, pose)
    ideal = projected(points, camera(), pose)  # far outside, the polynomial folds back into the image
    kept = ((np.minimum(where, ideal) > 12) & (np.maximum(where, ideal) < (627, 467))).all(axis=1)
    assert kept.sum() > 25
    points, where = points[kept], where[kept]
    squares = np.array([[-0.005, -0.005, 0], [0.005, -0.005, 0], [0.005, 0.005, 0], [-0.005, 0.005, 0]])
    # a square's own centre of light, by Gauss over its four projected quarters
    inner = np.mean([projected(points + corner / np.sqrt(3.0), info, pose) for corner in squares], axis=0)
    image = render([plate(tuple(point), 0.01) for point in points], info, pose, EXACT)
    assert np.abs(centroids(image, where) - inner).max() < 0.05  # three samples a side: steps of a third of a pixel


def test_leaving_the_distortion_out_would_be_seen() -> None:
    """The test above has to be able to fail: at the edge of the image this lens moves points by many pixels."""
    points = np.array([[0.25, 0.18, 0.0]])
    pose: Rigid = ((0.0, 0.0, 0.6), DOWN)
    assert np.abs(projected(points, camera(BARREL), pose) - projected(points, camera(), pose)).max() > 5.0


def test_what_is_nearer_hides_what_is_farther_also_where_its_centre_is_farther() -> None:
    """Painter's order by the faces' centres draws a large table over a small tag near the far edge of it."""
    pose: Rigid = ((-0.6, 0.0, 0.35), from_rpy(-2.1, 0.0, -np.pi / 2.0))
    corners = np.array([[-0.7, -1.0, 0.0], [3.0, -1.0, 0.0], [3.0, 1.0, 0.0], [-0.7, 1.0, 0.0]])
    table = PosedSolid((Face(corners, (90, 60, 30)),))
    tags = [
        tag("apriltag_36h11", n, 0.06, ((0.16 * (n // 4) - 0.1, 0.1 * (n % 4) - 0.15, 1e-4), DOWN_UP)) for n in range(8)
    ]
    table_centre, tag_centres = corners.mean(axis=0), np.array([each.pose[0] for each in tags])
    distances = np.linalg.norm(tag_centres - pose[0], axis=1), np.linalg.norm(table_centre - pose[0])
    assert (
        distances[0] < distances[1]
    ).all()  # by centres all tags are in front; they must be with any order of drawing
    seen = [ids_in(render(order, camera(), pose, EXACT)) for order in ([table, *tags], [*tags, table])]
    assert seen == [set(range(8))] * 2


def test_a_tag_behind_the_arm_is_hidden_and_one_in_front_of_it_is_not() -> None:
    pose: Rigid = ((0.0, 0.0, 0.5), DOWN)
    bar = box((0.5, 0.04, 0.02), (200, 120, 0), ((0.0, 0.0, 0.1), IDENTITY[1]))
    below = tag("apriltag_36h11", 1, 0.04, ((-0.08, 0.0, 0.0), DOWN_UP))
    above = tag("apriltag_36h11", 2, 0.03, ((0.08, 0.0, 0.1101), DOWN_UP))
    for order in ([bar, below, above], [above, below, bar]):
        assert ids_in(render(order, camera(), pose, EXACT)) == {2}


def test_faces_that_pass_through_one_another_meet_where_they_do() -> None:
    """No order of whole faces can draw this: half of each hides half of the other."""
    pose: Rigid = ((0.0, 0.0, 0.5), DOWN)
    tilt = from_rpy(0.0, 0.5, 0.0)
    back = from_rpy(0.0, -0.5, 0.0)
    red = PosedSolid(box((0.2, 0.2, 0.001), (255, 0, 0)).faces, ((0.0, 0.0, 0.0), tilt))
    blue = PosedSolid(box((0.2, 0.2, 0.001), (0, 0, 255)).faces, ((0.0, 0.0, 0.0), back))
    image = render([red, blue], camera(), pose, EXACT)
    left, right = image[236, 325 - 40], image[236, 325 + 40]
    assert left[0] > 100 > left[2]
    assert right[2] > 100 > right[0]


def test_what_is_behind_the_camera_is_not_seen_and_what_reaches_there_is_in_part() -> None:
    pose: Rigid = ((0.0, 0.0, 0.5), DOWN)
    behind = box((0.2, 0.2, 0.1), (255, 0, 0), ((0.0, 0.0, 0.8), IDENTITY[1]))
    assert not render([behind], camera(), pose, EXACT).any()
    beside = box((0.1, 0.1, 2.0), (0, 255, 0), ((0.25, 0.0, 0.0), IDENTITY[1]))  # from -1 m to 1 m: past the camera
    image = render([beside], camera(), pose, EXACT)
    assert image[236, 630, 1] > 0
    assert not image[236, 325].any()


@pytest.mark.parametrize("make", [lambda: cylinder(0.05, 0.1, WHITE), lambda: sphere(0.05, WHITE)])
def test_what_is_round_covers_the_area_of_a_circle(make) -> None:
    image = render([make()], camera(), ((0.0, 0.0, 2.0), DOWN), EXACT)
    focal = np.sqrt(554.3 * 551.1)
    area = (image.max(axis=2) > 100).sum()
    distance = 1.95 if make().faces[0].corners.shape[0] > 4 else 2.0
    assert area == pytest.approx(np.pi * (0.05 * focal / distance) ** 2, rel=0.06)


@pytest.mark.parametrize("family", ["apriltag_36h11", "aruco_4x4_50"])
def test_tags_are_read_by_opencv_the_right_way_round(family: str) -> None:
    """The first corner of a marker is its top left: x to the right and y up in the tag's frame."""
    info, pose = camera(), ((0.0, 0.0, 0.4), DOWN)
    turn = from_rpy(0.0, 0.0, 0.7)
    image = render([tag(family, 7, 0.05, ((0.02, 0.01, 0.0), turn))], info, pose, EXACT)
    corners, numbers = detector(family).detectMarkers(image)[:2]
    assert numbers.ravel().tolist() == [7]
    at = (
        np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
        * 0.025
        @ np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    )
    true = projected(np.column_stack((at + np.array([0.02, 0.01]), np.zeros(4))), info, pose)
    assert np.abs(corners[0].reshape(4, 2) - true).max() < 1.5


def test_noise_blur_motion_brightness_and_glare_do_what_they_say() -> None:
    pose: Rigid = ((0.0, 0.0, 0.5), DOWN)
    floor = box((2.0, 2.0, 0.01), (120, 120, 120))
    calm = Optics(blur=0.0, noise=0.0)
    flat = render([floor], camera(), pose, calm).astype(float)
    grainy = render([floor], camera(), pose, Optics(blur=0.0, noise=3.0), seed=4)
    assert (grainy - flat).std() == pytest.approx(3.0, rel=0.05)
    assert (grainy == render([floor], camera(), pose, Optics(blur=0.0, noise=3.0), seed=4)).all()
    other = render([floor], camera(), pose, Optics(blur=0.0, noise=3.0), seed=5)
    assert abs(np.corrcoef((grainy - flat).ravel(), (other - flat).ravel())[0, 1]) < 0.01
    dark = render([floor], camera(), pose, Optics(blur=0.0, noise=0.0, brightness=0.1))
    assert dark.mean() == pytest.approx(0.1 * flat.mean(), abs=1.0)
    shining = render([floor], camera(), pose, Optics(blur=0.0, noise=0.0, glare=((100.0, 200.0, 20.0),)))
    assert shining[200, 100].min() == 255
    assert (shining[400, 600] == flat[400, 600]).all()
    edge = box((0.2, 0.4, 0.01), WHITE)
    assert width_of_edge(render([edge], camera(), pose, calm)) < 1.5
    assert width_of_edge(render([edge], camera(), pose, Optics(blur=0.0, noise=0.0, motion=(8.0, 0.0)))) == (
        pytest.approx(8.0, abs=1.5)
    )


DOWN_UP = IDENTITY[1]  # a tag that lies on the table and looks up


def width_of_edge(image: np.ndarray) -> float:
    """[px] the transition of an upright edge in the left half of the image's middle row."""
    row = image[236, :325, 0].astype(float)
    low, high = row.min(), row.max()
    return float(((row > low + 0.02 * (high - low)) & (row < high - 0.02 * (high - low))).sum())


def detector(family: str) -> cv2.aruco.ArucoDetector:
    name = family.replace("aruco_", "").upper()
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}")))


def ids_in(image: np.ndarray) -> set[int]:
    numbers = detector("apriltag_36h11").detectMarkers(image)[1]
    return set() if numbers is None else set(numbers.ravel().tolist())
