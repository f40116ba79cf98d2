"""The choice of configurations for a camera's calibration: those within its sight that determine its pose best.

Many poses of the board before the camera are drawn and brought as near as the joints allow; of those in which the
camera would see it, each next one is that which tells most beside those before it (a D-optimal design, greedily). So
turns about two axes, tilts and distances come about by themselves where the arm can make them, and what it cannot make
is known before anything has moved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.calibration.determined import determined, information, prior_information
from gemelo.libraries.vision.calibration.link_pose import LinkAt
from gemelo.libraries.vision.calibration.reprojection import BoardView, Carrier, Reprojection, exact_arm, problem_of
from gemelo.libraries.vision.calibration.touches import board_in_camera
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, apply, inverse, rigid, turn, turn_vector
from gemelo.schemas.reasons import Reason

DRAWN = 160  # poses of the board
MOST_TILT = np.radians(40.0)  # of the board from facing the camera
MOST_SLANT = np.radians(58.0)  # at which it is still used, where an arm cannot turn it
MOST_TWIST = np.radians(75.0)  # about the line of sight
NEAREST, FARTHEST = 0.15, 0.9  # [m]
SMALLEST_MODULE = 3.5  # [px] of a tag's data
MODULES = 8.0  # of a tag, from edge to edge
BORDER = 0.08  # of the image's smaller side that stays free, for what is not yet known of the camera
SIGMA = 0.1  # [px] of a corner, about
FROM_LIMITS = 0.02  # of a joint's travel that stays free at its ends
STEPS, DAMPING, STEP = 14, 0.02, 1e-5  # of the search for a configuration
LENGTH = 0.15  # [m] that count as much as a turn of 1 rad in that search
STRAY = 0.2  # of a joint's travel about which the search starts around where the arm stands
UNLIKE = 0.05  # [rad] or [m]: configurations whose joints are nearer than this are one

MayStand = Callable[[Array], bool]


@dataclass(frozen=True)
class Belief:
    """What is taken for true before anything is measured."""

    model: CameraModel
    carrier: Carrier
    camera: Array  # (4, 4) in its parent
    board: Array  # (4, 4) in what carries it
    points: Array  # (n, 3) [m] of the board, four corners of a tag after the other
    height: float | None = None  # [m] as of `fit_mount`

    def camera_from_board(self, base_from_link: Array) -> Array:
        """camera_from_board (4, 4) for a carrier at `base_from_link` (4, 4)."""
        motion = base_from_link if self.carrier is Carrier.BOARD else inverse(base_from_link)
        return inverse(self.camera) @ motion @ self.board

    def is_seen(self, camera_from_board: Array) -> bool:
        """True if all of the board at (4, 4) is in the image, large enough, and turned to the camera."""
        placed = apply(camera_from_board, self.points)
        away = placed.mean(axis=0)
        slant = -float(camera_from_board[:3, 2] @ away) / float(np.linalg.norm(away))
        if placed[:, 2].min() < NEAREST / 2.0 or slant < np.cos(MOST_SLANT):
            return False
        module = self.model.focal[0] / placed[:, 2].max() * self.tag / MODULES * slant
        border = BORDER * min(self.model.width, self.model.height)
        pixels = self.model.project(placed)
        is_within = (pixels > border).all() and (
            pixels < np.array([self.model.width, self.model.height]) - border
        ).all()
        return bool(is_within and module > SMALLEST_MODULE)

    def seeing(self, base_from_link: Array, sighting: Sighting) -> Belief:
        """The same with the board where one view from (4, 4) shows it, the camera being where it is taken to be."""
        motion = base_from_link if self.carrier is Carrier.BOARD else inverse(base_from_link)
        return replace(self, board=inverse(motion) @ self.camera @ board_in_camera(sighting, self.model))

    @property
    def tag(self) -> float:
        """[m] the edge of a tag."""
        return float(np.linalg.norm(self.points[1] - self.points[0]))

    @property
    def problem(self) -> Reprojection:
        """What `fit_mount` would have, before any view."""
        return Reprojection((), self.model, self.carrier, self.height)

    def view(self, base_from_link: Array) -> BoardView:
        """What the camera would see from base_from_link (4, 4)."""
        pixels = self.model.project(apply(self.camera_from_board(base_from_link), self.points))
        return BoardView(base_from_link, Sighting(self.points, pixels, SIGMA))


@dataclass(frozen=True)
class Chosen:
    """Configurations in the order in which they are best driven through."""

    joints: tuple[Array, ...]  # (n,) [rad] or [m] each
    camera_from_board: tuple[Array, ...]  # what is expected in each
    undetermined: tuple[Reason, ...]  # what even all of them cannot tell

    @property
    def turns(self) -> Array:
        """(3,) [rad] RMS turns of the board before the camera about its principal axes, the largest first: the second
        is 0 where an arm turns it about one axis only."""
        first = self.camera_from_board[0][:3, :3]
        vectors = np.array([turn_vector(first.T @ pose[:3, :3]) for pose in self.camera_from_board])
        away = vectors - vectors.mean(axis=0)
        return np.asarray(np.linalg.svd(away, compute_uv=False) / np.sqrt(len(vectors)), dtype=np.float64)

    @property
    def distances(self) -> tuple[float, float]:
        """[m] the least and the greatest from the camera."""
        away = [float(np.linalg.norm(pose[:3, 3])) for pose in self.camera_from_board]
        return min(away), max(away)


def choose_poses(
    belief: Belief, link_at: LinkAt, limits: tuple[Array, Array], start: Array, may_stand: MayStand, count: int,
    seed: int = 0,
) -> Chosen:  # fmt: skip
    """At most `count` configurations beside `start` (n,), whose view counts as seen; the same `seed`, the same ones.

    `limits` are the joints' lower and upper values (n,); `may_stand` is asked only of those that would be chosen.
    """
    candidates = list(_candidates(belief, link_at, limits, start, np.random.default_rng(seed)))
    views = [belief.view(link_at(joints)) for joints in candidates]
    told = [_told(belief, view) for view in views]
    total = _told(belief, belief.view(link_at(start))) + prior_information(belief.problem) + np.eye(12)
    chosen: list[int] = []
    left = list(range(len(candidates)))
    while left and len(chosen) < count:
        gains = np.linalg.slogdet(np.array([total + told[index] for index in left]))[1]
        best = left.pop(int(np.argmax(gains)))
        others = [start, *(candidates[index] for index in chosen)]
        if any(_apart(candidates[best], other) < UNLIKE for other in others) or not may_stand(candidates[best]):
            continue
        chosen.append(best)
        total = total + told[best]
    ordered = _shortest(start, [candidates[index] for index in chosen])
    return _result(belief, link_at, start, ordered)


def _result(belief: Belief, link_at: LinkAt, start: Array, joints: Sequence[Array]) -> Chosen:
    links = [link_at(each) for each in (start, *joints)]
    views = tuple(belief.view(link) for link in links)
    problem = problem_of(views, belief.model, belief.carrier, belief.height)
    undetermined = determined(problem, exact_arm(belief.camera, belief.board, len(views)))[1]
    return Chosen(tuple(joints), tuple(belief.camera_from_board(link) for link in links[1:]), undetermined)


def _told(belief: Belief, view: BoardView) -> Array:
    """(12, 12) what one view would tell."""
    problem = Reprojection((view,), belief.model, belief.carrier)
    return information(problem, exact_arm(belief.camera, belief.board, 1), 0)


def _candidates(
    belief: Belief, link_at: LinkAt, limits: tuple[Array, Array], start: Array, random: np.random.Generator
) -> list[Array]:
    """Configurations in which the camera would see the board."""
    travel = np.where(np.isfinite(limits[1] - limits[0]), limits[1] - limits[0], 2.0 * np.pi)
    lower, upper = limits[0] + FROM_LIMITS * travel, limits[1] - FROM_LIMITS * travel
    facing = _facing(belief.camera_from_board(link_at(start)))
    found = []
    for _ in range(DRAWN):
        wanted = _drawn(belief, facing, random)
        begin = np.clip(start + STRAY * travel * random.uniform(-1.0, 1.0, len(start)), lower, upper)
        joints = _brought(belief, link_at, wanted, begin, (lower, upper))
        if belief.is_seen(belief.camera_from_board(link_at(joints))):
            found.append(joints)
    return found


def _drawn(belief: Belief, facing: Array, random: np.random.Generator) -> Array:
    """camera_from_board in which the board is in sight, turned and tilted at random from `facing` (3, 3)."""
    radius = float(np.linalg.norm(belief.points, axis=1).max())
    focal, width, height = belief.model.focal[0], belief.model.width, belief.model.height
    nearest = max(NEAREST, radius * focal / (0.42 * min(width, height)))
    farthest = max(nearest, min(FARTHEST, belief.tag * focal / (MODULES * SMALLEST_MODULE)))
    away = random.uniform(nearest, farthest)
    room = np.maximum(np.array([width, height]) / 2.0 * (1.0 - 2.0 * BORDER) - radius * focal / away, 0.0)
    place = np.append(random.uniform(-room, room) / focal, 1.0) * away
    about, tilt = random.uniform(0.0, 2.0 * np.pi), MOST_TILT * np.sqrt(random.uniform(0.0, 1.0))
    twist = turn(np.array([0.0, 0.0, random.uniform(-MOST_TWIST, MOST_TWIST)]))
    tilted = turn(tilt * np.array([np.cos(about), np.sin(about), 0.0]))
    return rigid(tilted @ facing @ twist, place)


def _facing(pose: Array) -> Array:
    """The rotation (3, 3) of camera_from_board after the shortest turn that lets the board face the camera."""
    across = np.cross(pose[:3, 2], (0.0, 0.0, -1.0))
    sine, cosine = float(np.linalg.norm(across)), -float(pose[2, 2])
    return turn(across * (np.arctan2(sine, cosine) / max(sine, 1e-9))) @ pose[:3, :3]


def _brought(belief: Belief, link_at: LinkAt, wanted: Array, joints: Array, limits: tuple[Array, Array]) -> Array:
    """The joint values within `limits` that bring the board nearest to `wanted` before the camera, from `joints` on
    (damped least squares, slopes by differences)."""

    def off(values: Array) -> Array:
        pose = belief.camera_from_board(link_at(values))
        turned = turn_vector(wanted[:3, :3].T @ pose[:3, :3])
        return np.concatenate((turned, (pose[:3, 3] - wanted[:3, 3]) / LENGTH))

    best, least = joints, off(joints)
    damping = DAMPING
    for _ in range(STEPS):
        slope = np.stack([(off(best + STEP * axis) - least) / STEP for axis in np.eye(len(best))], axis=1)
        change = np.linalg.solve(slope.T @ slope + damping * np.eye(len(best)), slope.T @ least)
        candidate = np.clip(best - change, *limits)
        now = off(candidate)
        if now @ now < least @ least:
            best, least, damping = candidate, now, damping / 5.0
        else:
            damping *= 8.0
        if least @ least < 1e-5 or damping > 1e3:
            break
    return best


def _apart(first: Array, second: Array) -> float:
    return float(np.abs(first - second).max())


def _shortest(start: Array, joints: list[Array]) -> list[Array]:
    """The same, each next one the nearest to the last."""
    ordered, left, last = [], list(joints), start
    while left:
        nearest = min(range(len(left)), key=lambda index: _apart(left[index], last))
        last = left.pop(nearest)
        ordered.append(last)
    return ordered
