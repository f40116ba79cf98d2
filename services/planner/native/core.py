"""`MotionCore`: one arm, its spheres, what stands around it, and the questions that can be asked of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from services.arm.description import Arm
from services.planner.link_spheres import cover_shapes, link_shapes
from services.planner.native.chain import frames_of
from services.planner.native.library import CancelFlag, motion
from services.planner.native.obstacles import obstacle_of
from services.planner.native.paths import Effort, FreePath, NoPath, Why
from services.planner.shapes import Attachment, Shape
from services.planner.spheres import BULGE, Cover

Array = NDArray[np.float64]

MARGIN = 0.001  # [m]
FINEST = 0.0002  # [m] how much nearer than the margin a way may seem before it is refused
FOUND = 0  # plan.h
ATTACHED_SHARE = 1.0 / 40.0  # of an attached thing's longest side may be bulge
OBSTACLES = 64  # the first obstacle's number in a contact: kMaxParts


class Contact(NamedTuple):
    """The names of two links, attached things or obstacles."""

    first: str
    second: str


class MotionCore:
    """Answers are about the spheres that cover the links: "free" holds for them too, "not free" may be the bulge's.

    A question and a change of the scene may come from different threads: a running plan keeps the scene it began with.
    """

    def __init__(self, arm: Arm, margin: float = MARGIN, bulge: float = BULGE, kernel: str = "") -> None:
        """`margin` [m] stays free around everything; `kernel` "avx2", "vector", "plain", or "" for the fastest."""
        self.arm = arm
        self.margin = margin
        shapes = link_shapes(arm)
        self.covers = {link: cover_shapes(several, bulge) for link, several in shapes.items()}
        self._frames = frames_of(arm)
        self._kernel = motion.kernel(kernel)
        self._chain = motion.chain(self._frames.links, self._frames.numbers, len(arm.joints))
        self._link_parts = {link: self._part(link, shapes[link], cover) for link, cover in self.covers.items()}
        self._shapes: tuple[Shape, ...] = ()
        self._attached: dict[str, tuple[Attachment, motion.Part]] = {}
        self._names: list[str] = []
        self._world = self._build()

    @property
    def kernel(self) -> str:
        """Which build of the check answers."""
        return self._kernel.name

    @property
    def sphere_count(self) -> int:
        """Of all links; never zero."""
        return sum(len(cover.spheres) for cover in self.covers.values())

    def set_scene(self, shapes: Sequence[Shape]) -> None:
        """Replaces all obstacles; raises ValueError where two have one name or one names an unknown link."""
        names = [shape.name for shape in shapes]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f'the scene has "{name}" twice')
        before, self._shapes = self._shapes, tuple(shapes)
        try:
            self._world = self._build()
        except ValueError:
            self._shapes = before
            raise

    def attach(self, attachment: Attachment) -> None:
        """From now on these shapes move with their link; replaces what had the same name."""
        if attachment.link not in self._frames.places:
            raise ValueError(f'"{attachment.name}": {self.arm.name} has no link "{attachment.link}"')
        cover = cover_shapes(attachment.shapes, attached_bulge(attachment.shapes))
        self._attached[attachment.name] = (attachment, self._part(attachment.link, attachment.shapes, cover))
        try:
            self._world = self._build()
        except ValueError:
            self.detach(attachment.name)
            raise

    def detach(self, name: str) -> None:
        """Lets go of it; raises ValueError where there is nothing of that name."""
        if name not in self._attached:
            raise ValueError(f'nothing called "{name}" is attached, only {", ".join(self._attached) or "nothing"}')
        del self._attached[name]
        self._world = self._build()

    def free(self, positions: ArrayLike) -> NDArray[np.bool_]:
        """(rows,) whether each row of `positions` (rows, n) keeps the margin to itself and everything else."""
        return motion.are_free(self._world, self._kernel, self._rows(positions), self.margin)

    def edge_free(self, start: ArrayLike, goal: ArrayLike) -> bool:
        """Whether the whole straight line of the joints keeps the margin, between samples too."""
        return self.way_free(np.vstack((self._row(start), self._row(goal))))

    def way_free(self, rows: ArrayLike) -> bool:
        """Whether the polyline through `rows` (m, n) keeps the margin everywhere."""
        return self._look(self._rows(rows), 1)

    def spline_free(self, control: ArrayLike) -> bool:
        """Whether the uniform cubic B-spline of the control points (k, n) keeps the margin everywhere."""
        return self._look(self._rows(control), 3)

    def distance(self, positions: ArrayLike, most: float = 1.0) -> float:
        """[m] that the arm keeps at least to itself and everything else; 0 where spheres touch, at most `most`."""
        return motion.clearance(self._world, self._kernel, self._row(positions), most)[0]

    def nearest(self, positions: ArrayLike, most: float = 1.0) -> Contact | None:
        """The two that are nearest to one another, None where all are farther than `most` [m]."""
        _, first, second = motion.clearance(self._world, self._kernel, self._row(positions), most)
        return self._contact(first, second)

    def first_contact(self, positions: ArrayLike) -> Contact | None:
        """Two that do not keep the margin, None where the posture is free."""
        touches, first, second = motion.first_contact(self._world, self._kernel, self._row(positions), self.margin)
        return self._contact(first, second) if touches else None

    def plan(
        self,
        start: ArrayLike,
        goals: ArrayLike,
        seed: int = 0,
        time_limit: float = math.inf,
        cancel: CancelFlag | None = None,
    ) -> FreePath | NoPath:
        """A way from `start` (n,) to one of `goals` (n,) or (m, n), by RRT-Connect, shortened and smoothed.

        The same seed gives the same path, unless `time_limit` [s] cuts the shortening off. Distances are counted in
        time at full speed. The interpreter's lock is released; `cancel` may be set from another thread.
        """
        rows = self._rows(np.atleast_2d(np.asarray(goals, dtype=np.float64)))
        bounds = np.array([self._lower(), self._upper(), [1.0 / joint.velocity for joint in self.arm.joints]])
        at = self._row(start)
        done = motion.plan(self._world, self._kernel, bounds, at, rows, seed, self.margin, time_limit, cancel)
        effort = Effort(done.search_s, done.shorten_s, done.smooth_s, done.iterations, done.checks)
        if done.outcome != FOUND:
            return NoPath(Why(done.outcome), effort)
        return FreePath(done.way(len(self.arm.joints)), done.control(len(self.arm.joints)), effort)

    def sphere_centres(self, positions: ArrayLike) -> NDArray[np.float32]:
        """(rows, spheres, 3) [m] in the base, in the order of the trees: for tests and pictures."""
        return motion.centres(self._world, self._kernel, self._rows(positions))

    def _lower(self) -> list[float]:
        return [max(joint.lower, -math.pi) if joint.unit == "rad" else joint.lower for joint in self.arm.joints]

    def _upper(self) -> list[float]:
        return [min(joint.upper, math.pi) if joint.unit == "rad" else joint.upper for joint in self.arm.joints]

    def _rows(self, values: ArrayLike) -> Array:
        rows = np.ascontiguousarray(values, dtype=np.float64)
        if rows.ndim != 2:
            raise ValueError(f"joint values must be (rows, {len(self.arm.joints)}), not {rows.shape}")
        return rows

    def _row(self, values: ArrayLike) -> Array:
        row = np.ascontiguousarray(values, dtype=np.float64)
        if row.shape != (len(self.arm.joints),):
            raise ValueError(f"joint values must be ({len(self.arm.joints)},), not {row.shape}")
        return row

    def _look(self, rows: Array, degree: int) -> bool:
        return motion.look(self._world, self._kernel, rows, degree, self.margin, FINEST, math.inf, None)[0] == FOUND

    def _contact(self, first: int, second: int) -> Contact | None:
        if first < 0:
            return None
        other = self._shapes[second - OBSTACLES].name if second >= OBSTACLES else self._names[second]
        return Contact(self._names[first], other)

    def _part(self, link: str, shapes: Sequence[Shape], cover: Cover) -> motion.Part:
        """A link's solids and their spheres in its frame, larger by what floats lose on an arm of this reach."""
        frame, pose = self._frames.places[link]
        spheres = cover.spheres.copy()
        spheres[:, :3] = spheres[:, :3] @ pose[:3, :3].T + pose[:3, 3]
        spheres[:, 3] += self._rounding()
        solids = [obstacle_of(shape, pose @ shape.matrix, self._rounding()) for shape in shapes]
        return motion.part(frame, np.ascontiguousarray(spheres), solids)

    def _rounding(self) -> float:
        """[m]: a float has 24 bits; some fifty operations on the way to a sphere's centre, angles up to 100 rad."""
        steps = np.linalg.norm(self._frames.numbers[:, 9:12], axis=1)
        return 2e-5 * max(1.0, float(steps.sum() + self._frames.numbers[:, 14].sum()))

    def _build(self) -> motion.World:
        """Links, then what is attached; pairs that the SRDF does not excuse and that a joint can move apart."""
        parts = [(name, name, part) for name, part in self._link_parts.items()]
        parts += [(name, attachment.link, part) for name, (attachment, part) in self._attached.items()]
        names = [name for name, _, _ in parts]
        pairs = [
            (first, second)
            for first in range(len(parts))
            for second in range(first + 1, len(parts))
            if self._is_checked(parts[first][:2], parts[second][:2])
        ]
        obstacles = [
            obstacle_of(shape, shape.matrix, touching=sum(1 << self._number(names, name) for name in shape.touching))
            for shape in self._shapes
        ]
        both = np.array(pairs, dtype=np.int32).reshape(-1, 2)
        world = motion.world(self._chain, [part for _, _, part in parts], both, obstacles)
        self._names = names
        return world

    def _is_checked(self, one: tuple[str, str], other: tuple[str, str]) -> bool:
        """(name, link) of two parts; an attached one has its own list of links that it may touch."""
        (name, link), (second_name, second_link) = one, other
        if self._frames.places[link][0] == self._frames.places[second_link][0]:
            return False
        for attached, touched in ((name, second_link), (second_name, link)):
            if attached in self._attached and touched in self._attached[attached][0].touching:
                return False
        if name in self._attached or second_name in self._attached:
            return True
        return not self.arm.collisions_are_disabled(link, second_link)

    def _number(self, names: list[str], name: str) -> int:
        if name not in names:
            raise ValueError(f'"{name}" is neither a link with a collision shape nor attached: {", ".join(names)}')
        return names.index(name)


def attached_bulge(shapes: Sequence[Shape]) -> float:
    """[m]: more for what is large, which has to be covered while somebody waits."""
    longest = max((size for shape in shapes for size in shape.size), default=0.0)
    meshes = [float(np.ptp(shape.mesh.vertices, axis=0).max()) for shape in shapes if shape.mesh is not None]
    return max(BULGE, ATTACHED_SHARE * max([longest, *meshes]))
