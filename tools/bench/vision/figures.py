"""Figures of the eyes, on rendered images with exact ground truth; OpenCV's own ways are measured on the same ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial

import cv2
import numpy as np
from msgspec.structs import replace

from gemelo.libraries.vision.boards import TagBoard
from gemelo.libraries.vision.boxes import colour_strength, coloured_regions, fit_box, region_centre
from gemelo.libraries.vision.calibration.mount import fit_mount
from gemelo.libraries.vision.calibration.reprojection import Carrier
from gemelo.libraries.vision.camera_model import of_field_of_view
from gemelo.libraries.vision.rigid import Array, angle_between, rigid
from gemelo.libraries.vision.tag_pose import flat, plane_pose, tag_pose
from gemelo.libraries.vision.tags import find_tags
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile
from gemelo.tools.bench.scenes import parol6, rm1
from gemelo.tools.bench.vision.images import (
    Conditions,
    Image,
    box_surfaces,
    looking_down,
    render,
    tag_surface,
)
from gemelo.tools.bench.vision.mount_images import (
    Setup,
    Sight,
    board_on_tool,
    camera_on_link,
    tag_on_level_tool,
    take,
)
from gemelo.tools.bench.vision.mounting import MountingTrial, closed_form, level_trial, six_joint_trial, tool_error
from gemelo.tools.bench.vision.naive import APRILTAG_SHIFT, METHODS, opencv_corners, opencv_pose

MODEL = of_field_of_view(np.radians(60.0), 640, 480)
SIZE, DISTANCE = 0.03, 0.5  # [m]
TAGS, FLIPS, BOXES, TRIALS, TIMED, IMAGED = 300, 1000, 60, 6, 100, 3
FLIPPED = np.radians(15.0)
EDGES = (0.03, 0.03, 0.03)  # [m] of the box
RED = np.array([200.0, 40.0, 35.0])
GREY = Conditions(background=np.array([150.0, 150.0, 150.0]))
SAID = "30 mm tag at 0.5 m, 45 to 85 degrees above the table, 640 x 480, noise 3, blur 0.6"


@dataclass(frozen=True)
class TagView:
    """One tag on the table."""

    image: Image
    camera_from_table: Array  # (4, 4)
    camera_from_tag: Array  # (4, 4)

    def off(self, pose: Array) -> float:
        """[mm] between `pose` and the truth."""
        return 1000.0 * float(np.linalg.norm(pose[:3, 3] - self.camera_from_tag[:3, 3]))


def views(count: int, conditions: Conditions | None = None, seed: int = 1) -> Iterator[TagView]:
    """Views from all sides; the same ones in every run."""
    random = np.random.default_rng(seed)
    for number in range(count):
        table = looking_down(DISTANCE, np.radians(random.uniform(45.0, 85.0)), random.uniform(0.0, 6.28))
        place = flat(np.array([random.uniform(-0.1, 0.1), random.uniform(-0.08, 0.08), random.uniform(0.0, 6.28)]))
        pose = table @ place
        yield TagView(render(MODEL, [tag_surface(pose, SIZE, number % 30)], random, conditions), table, pose)


@cache
def common_views() -> tuple[TagView, ...]:
    """Those that several figures are measured on."""
    return tuple(views(TAGS))


def of_share(samples: list[float], goal: float, share: float, reference: dict[str, float], note: str) -> Figure:
    """A figure whose `goal`, in its unit, is an upper bound of the quantile `share`."""
    figure = of_samples(samples, reference=reference, note=note)
    value = quantile(samples, share)
    return replace(figure, goal=f"p{100 * share:.0f} <= {goal:g}", met=value <= goal, note=f"{note}; p95 {value:.3g}")


def tag_pose_mm() -> Figure:
    """Error of a tag's position in space [mm]; OpenCV's corners on the same images."""
    ours = [
        view.off(tag_pose(tag, MODEL, SIZE, view.camera_from_table[:3, 2]).camera_from_tag)
        for view in common_views()
        for tag in find_tags(view.image, MODEL)
    ]
    if len(ours) != TAGS:
        raise NotMeasured(f"{len(ours)} of {TAGS} tags were found")
    reference: dict[str, float] = {}
    for method in METHODS:
        shift = APRILTAG_SHIFT if method == "APRILTAG" else 0.0
        found = [(view, opencv_corners(view.image, method)) for view in common_views()]
        off = [view.off(opencv_pose(c - shift, MODEL, SIZE)) for view, c in found if c is not None]
        said = f"{method} minus 0.5 px" if shift else method
        reference |= {f"{said}, median": quantile(off, 0.5), f"{said}, p95": quantile(off, 0.95)}
    return of_share(ours, 0.5, 0.95, reference, SAID)


def tag_plane_mm() -> Figure:
    """Error of a tag's position on the known table [mm]."""
    ours = [
        view.off(plane_pose(tag, MODEL, SIZE, view.camera_from_table)[0])
        for view in common_views()
        for tag in find_tags(view.image, MODEL)
    ]
    return of_share(ours, 0.1, 0.95, {}, SAID)


def tag_flips() -> Figure:
    """Flipped poses of 1,000, chosen by the table's normal; without it, by the error alone, is the reference."""
    ours = alone = found = 0
    for view in views(FLIPS, seed=2):
        for tag in find_tags(view.image, MODEL):
            found += 1
            pose = tag_pose(tag, MODEL, SIZE, view.camera_from_table[:3, 2]).camera_from_tag
            ours += angle_between(pose, view.camera_from_tag) > FLIPPED
            alone += angle_between(tag_pose(tag, MODEL, SIZE).camera_from_tag, view.camera_from_tag) > FLIPPED
    figure = of_samples([float(ours)], reference={"by the error alone": float(alone)}, note=f"{found} tags; {SAID}")
    return replace(figure, goal="0 of 1000", met=ours == 0 and found == FLIPS)


def box_mm() -> Figure:
    """Error of a box's place on the table [mm]: its silhouette; the middle of its region is the reference."""
    random = np.random.default_rng(6)
    ours, naive = [], []
    for _ in range(BOXES):
        table = looking_down(DISTANCE, np.radians(random.choice([55.0, 85.0])), random.uniform(0.0, 6.28))
        values = np.array([random.uniform(-0.1, 0.1), random.uniform(-0.08, 0.08), random.uniform(0.0, 6.28)])
        box = table @ flat(values) @ rigid(np.zeros(3), np.array([0.0, 0.0, EDGES[2] / 2.0]))
        strength = colour_strength(render(MODEL, box_surfaces(box, EDGES, RED), random, GREY), RED)
        region = coloured_regions(strength)[0]
        fit = fit_box(strength, region, MODEL, table, EDGES)
        if fit is None:
            raise NotMeasured("a box was not found")
        ours.append(1000.0 * float(np.linalg.norm(fit.plane_from_box[:2, 3] - values[:2])))
        naive.append(1000.0 * float(np.linalg.norm(region_centre(region, MODEL, table, 0.0)[:2] - values[:2])))
    reference = {"middle of the region, median": quantile(naive, 0.5), "its p95": quantile(naive, 0.95)}
    return of_share(ours, 0.5, 0.95, reference, "30 mm cube of known size, camera 55 or 85 degrees above the table")


def image_to_pose_ms() -> Figure:
    """Time from a grey image with 8 tags to 8 poses [ms], OpenCV on one thread."""
    table = looking_down(DISTANCE, np.radians(70.0))
    places = [flat(np.array([x, y, x + y])) for x in (-0.12, -0.04, 0.04, 0.12) for y in (-0.05, 0.05)]
    surfaces = [tag_surface(table @ place, SIZE, number) for number, place in enumerate(places)]
    image = render(MODEL, surfaces, np.random.default_rng(0))
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        ours = timed(lambda: [tag_pose(tag, MODEL, SIZE) for tag in find_tags(image, MODEL)])
        reference = {
            f"{method} corners alone": quantile(timed(partial(opencv_corners, image, method)), 0.5)
            for method in METHODS
        }
    finally:
        cv2.setNumThreads(threads)
    return of_share(
        ours, 20.0, 0.95, reference, f"8 tags, of which {len(find_tags(image, MODEL))} were found, 640 x 480"
    )


def timed(work: Callable[[], object]) -> list[float]:
    """[ms] of each of TIMED runs."""
    found = []
    for _ in range(TIMED):
        start = time.perf_counter()
        work()
        found.append(1000.0 * (time.perf_counter() - start))
    return found


def mount_mm() -> Figure:
    """Error at what the camera sees by where it is said to stand [mm]: 15 poses, 9 tags, 0.3 px, and rm1 by height."""
    ours, park, level = [], [], []
    for seed in range(TRIALS):
        for carrier in Carrier:
            trial = six_joint_trial(MODEL, carrier, TagBoard(), 15, np.random.default_rng(seed))
            ours.append(mount_error(trial, carrier))
            found = closed_form(trial, MODEL, carrier, cv2.CALIB_HAND_EYE_PARK)
            park += [] if found is None else [tool_error(found, trial.parent_from_camera, carrier)]
    arm, one = rm1(), TagBoard(columns=1, rows=1)
    hand_eye = []
    for seed in range(TRIALS):
        trial = level_trial(arm, MODEL, one, 15, np.random.default_rng(seed))
        level.append(mount_error(trial, Carrier.BOARD, trial.carrier_from_board[2, 3]))
        found = closed_form(trial, MODEL, Carrier.BOARD, cv2.CALIB_HAND_EYE_PARK)
        hand_eye += [] if found is None else [tool_error(found, trial.parent_from_camera, Carrier.BOARD)]
    reference = {
        "calibrateHandEye (Park), median": quantile(park, 0.5),
        "rm1, one tag on the tool, height given, median": quantile(level, 0.5),
        **({"rm1, calibrateHandEye (Park), median": quantile(hand_eye, 0.5)} if hand_eye else {}),
    }
    return of_share(
        ours, 0.5, 0.95, reference, "six joints, 15 poses, 9 tags, 0.3 px, exact lens, camera on link or base"
    )


def mount_images_mm() -> Figure:
    """Error at what the camera sees by where the wizard says that it stands [mm], on images from the poses it chooses:
    parol6 with the camera on its wrist and with the board on its tool; `calibrateHandEye` from the same views."""
    ours: list[float] = []
    reference: dict[str, float] = {}
    ways = {"camera on the wrist": camera_on_link(parol6()), "board on the tool": board_on_tool(parol6())}
    for said, setup in (*ways.items(), ("rm1, tag on the tool, height given", tag_on_level_tool(rm1()))):
        off, park = mount_images(setup)
        reference |= {f"{said}, worst": max(off)}
        reference |= {f"{said}, calibrateHandEye (Park), worst": max(park)} if park else {}
        ours += off
    note = "poses chosen by the wizard, rendered 640 x 480, noise 3, blur 0.6, exact lens and arm; rm1's among them"
    return of_share(ours, 0.5, 1.0, reference, note)


def mount_images(setup: Setup) -> tuple[list[float], list[float]]:
    """[mm] of our own solutions and of Park's, one for each of several choices of poses."""
    sight, carrier = Sight(setup), setup.carrier
    ours, park = [], []
    for seed in range(IMAGED):
        taken = take(sight, setup.height if setup.arm.name == "rm1" else None, seed=seed)
        fit = fit_mount(taken.views, sight.model, carrier, taken.belief.height)
        if fit.faults:
            raise NotMeasured("; ".join(map(str, fit.faults)))
        ours.append(tool_error(fit.parent_from_camera, sight.truth, carrier))
        trial = MountingTrial(list(taken.views), sight.truth, setup.carrier_from_board)
        found = closed_form(trial, sight.model, carrier, cv2.CALIB_HAND_EYE_PARK)
        park += [] if found is None else [tool_error(found, sight.truth, carrier)]
    return ours, park


def mount_error(trial: MountingTrial, carrier: Carrier, height: float | None = None) -> float:
    """Error [mm] of our own solution; `height` [m] as of `fit_mount`."""
    fit = fit_mount(trial.views, MODEL, carrier, height)
    return tool_error(fit.parent_from_camera, trial.parent_from_camera, carrier)
