"""`NativePlanner`: one arm, its spheres, what stands around it, and the questions that can be asked of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.collision_geometry.shapes import Attachment, CollisionShape
from gemelo.services.planner.native.assembly import Assembly, wide_spheres
from gemelo.services.planner.native.binding import CancelFlag as NativeCancelFlag
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.distance_tables import JointsBetween, PairTable
from gemelo.services.planner.native.paths import Effort, FailureReason, FreePath, NoPath
from gemelo.services.planner.native.sphere_cover import BULGE, SphereCover
from gemelo.services.planner.request.deadline import CancelFlag

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
MARGIN = 0.001  # [m] chosen: the clearance of a world that is told none
FINEST = 0.0002  # [m] how much nearer than the margin a way may seem before it is refused
COARSE = 0.001  # [m] the same where the true shapes have the last word
FREE, TOUCHING = 0, 1  # standard: as in motion_validator.h
FOUND = 0  # standard: as in plan.h


class ContactPair(NamedTuple):
    """The names of two links, attached things or obstacles."""

    first: str
    second: str


class UnresolvedInterval(NamedTuple):
    """From one fractional row number of a polyline to another, and which pairs may come too near there."""

    begin: float
    end: float
    pairs: frozenset[ContactPair]


class NativePlanner:
    """Answers are about the spheres that cover the links: "free" holds for them too, "not free" may be the bulge's.

    A question and a change of the scene may come from different threads: a running plan keeps the scene it began with.
    """

    def __init__(self, arm: ArmDescription, margin: float = MARGIN, bulge: float = BULGE, kernel: str = "") -> None:
        """`margin` [m] stays free around everything; `kernel` "avx2", "vector", "plain", or "" for the fastest."""
        self.arm = arm
        self.margin = margin
        self._kernel = motion.kernel(kernel)
        self._bulge = bulge
        self._assembly = Assembly(arm, bulge)
        self._scene = self._assembly.compiled_scene((), {})
        self._lower, self._upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
        self._is_limited = bool(np.isfinite((self._lower, self._upper)).all())
        self._weights = 1.0 / np.array([joint.velocity for joint in arm.joints])

    @property
    def kernel(self) -> str:
        """Which build of the check answers."""
        return self._kernel.name

    @property
    def covers(self) -> Mapping[str, SphereCover]:
        """Each link's spheres, in its own frame, and how far they bulge."""
        return self._assembly.covers

    @property
    def large_links(self) -> Mapping[str, Reason]:
        """The links whose spheres reach far beyond their shapes, each with what that means."""
        shapes = link_shapes(self.arm)
        said = {
            link: wide_spheres(self.arm, link, shapes[link], cover, self._bulge) for link, cover in self.covers.items()
        }
        return {link: each for link, each in said.items() if each is not None}

    @property
    def contents(self) -> Mapping[str, bytes]:
        """A hash of each link's shapes."""
        return self._assembly.contents

    @property
    def joints_between(self) -> list[JointsBetween]:
        """Of every pair of links that is checked, which joints move them against one another."""
        return self._assembly.joints_between

    def set_tables(self, tables: Sequence[PairTable]) -> None:
        """From now on read before the spheres of these pairs of links."""
        self._assembly.set_tables(tables)
        self._scene = self._assembly.compiled_scene(self._scene.shapes, self._scene.held)

    @property
    def sphere_count(self) -> int:
        """Of all links; never zero."""
        return sum(len(cover.spheres) for cover in self.covers.values())

    def set_scene(self, shapes: Sequence[CollisionShape]) -> None:
        """Replaces all obstacles; raises ValueError, and changes nothing, where a name is unknown or there twice."""
        self._scene = self._assembly.compiled_scene(shapes, self._scene.held)

    def attach(self, attachment: Attachment) -> None:
        """From now on these shapes move with their link; replaces what had the same name."""
        held = {**self._scene.held, attachment.name: self._assembly.hold(attachment)}
        self._scene = self._assembly.compiled_scene(self._scene.shapes, held)

    def detach(self, name: str) -> None:
        """Lets go of it; raises ValueError where there is nothing of that name, or an obstacle still names it."""
        held = dict(self._scene.held)
        if name not in held:
            raise ValueError(f'nothing called "{name}" is attached, only {", ".join(held) or "nothing"}')
        del held[name]
        self._scene = self._assembly.compiled_scene(self._scene.shapes, held)

    @property
    def attached(self) -> tuple[str, ...]:
        """The names of what is attached."""
        return tuple(self._scene.held)

    def free(self, positions: ArrayLike, spare: float = 0.0) -> NDArray[np.bool_]:
        """(rows,) True for each row of `positions` (rows, n) [rad] or [m] that keeps the margin, and `spare` [m] more,
        to itself and everything else; raises ValueError for another shape."""
        return motion.are_free(self._scene.world, self._kernel, self._rows(positions), self.margin + spare)

    def is_free(self, positions: Sequence[float] | Array) -> bool:
        """True if the one configuration (n,) [rad] or [m] keeps the margin; raises ValueError for another shape."""
        return motion.is_free(self._scene.world, self._kernel, positions, self.margin)

    def edge_free(self, start: ArrayLike, goal: ArrayLike) -> bool:
        """True if the whole straight line of the joints from `start` to `goal`, (n,) [rad] or [m], keeps the margin,
        between samples too."""
        return self.path_free(np.vstack((self._row(start), self._row(goal))))

    def path_free(self, rows: ArrayLike) -> bool:
        """True if the polyline through `rows` (m, n) [rad] or [m] keeps the margin everywhere."""
        return self._look(self._rows(rows), 1)

    def spline_free(self, control: ArrayLike) -> bool:
        """True if the uniform cubic B-spline of the control points (k, n) [rad] or [m] keeps the margin everywhere."""
        return self._look(self._rows(control), 3)

    def unresolved_intervals(self, rows: ArrayLike) -> list[UnresolvedInterval]:
        """Where the polyline through `rows` (m, n) [rad] or [m] is not known to keep the margin, in order."""
        compiled_scene = self._scene
        found = motion.unresolved(compiled_scene.world, self._kernel, self._rows(rows), self.margin, COARSE)
        name_of = compiled_scene.name_of
        return [
            UnresolvedInterval(
                begin, end, frozenset(ContactPair(name_of(first), name_of(second)) for first, second in pairs.tolist())
            )
            for begin, end, pairs in found
        ]

    def touching(self, rows: ArrayLike) -> Array | None:
        """A configuration (n,) [rad] or [m] on the polyline through `rows` (m, n) that does not keep the margin,
        however much bulges.

        None where there is none, or where only the true shapes can tell.
        """
        cores = self._scene.cores
        if cores is None:
            return None
        verdict, configuration = motion.look(
            cores, self._kernel, self._rows(rows), 1, self.margin, FINEST, math.inf, None
        )
        return configuration if verdict == TOUCHING else None

    def distance(self, positions: ArrayLike, most: float = 1.0) -> float:
        """[m] that the arm keeps at least to itself and everything else; 0 where spheres touch, at most `most`."""
        return motion.clearance(self._scene.world, self._kernel, self._row(positions), most)[0]

    def nearest(self, positions: ArrayLike, most: float = 1.0) -> ContactPair | None:
        """The two that are nearest to one another, None where all are farther than `most` [m]."""
        compiled_scene = self._scene
        _, first, second = motion.clearance(compiled_scene.world, self._kernel, self._row(positions), most)
        return None if first < 0 else ContactPair(compiled_scene.name_of(first), compiled_scene.name_of(second))

    def first_contact(self, positions: ArrayLike) -> ContactPair | None:
        """The names of two that do not keep the margin at the joint values (n,) [rad] or [m]; None where the
        configuration is free."""
        compiled_scene = self._scene
        touches, first, second = motion.first_contact(
            compiled_scene.world, self._kernel, self._row(positions), self.margin
        )
        return ContactPair(compiled_scene.name_of(first), compiled_scene.name_of(second)) if touches else None

    def plan(
        self,
        start: ArrayLike,
        goals: ArrayLike,
        seed: int = 0,
        time_limit: float = math.inf,
        cancel: CancelFlag | None = None,
        enough: int = 0,
        are_lines_blocked: bool = False,
    ) -> FreePath | NoPath:
        """A path from `start` (n,) to one of `goals` (n,) or (m, n), by RRT-Connect, shortened and smoothed.

        The same seed gives the same path, unless `time_limit` [s] cuts the shortening off. Distances are counted in
        time at full speed. Other searches look for a shorter path until `enough` configurations have been checked, or
        fewer where it is not half as long again as the straight line: in proportion to what is to be gained. With
        `are_lines_blocked` the straight lines to all goals are known not to be free, and not looked at. The
        interpreter's lock is released; `cancel` may be set from another thread.
        """
        rows = self._rows(np.atleast_2d(np.asarray(goals, dtype=np.float64)))
        at = self._row(start)
        bounds = np.array((*self._span(at, rows), self._weights))
        flag = cancel if isinstance(cancel, NativeCancelFlag) else None  # another kind is only seen by the caller
        world, margin = self._scene.world, self.margin
        done = motion.plan(
            world, self._kernel, bounds, at, rows, seed, margin, time_limit, flag, enough, are_lines_blocked
        )
        effort = Effort(done.search_s, done.shorten_s, done.smooth_s, done.iterations, done.checks)
        if done.outcome != FOUND:
            return NoPath(FailureReason(done.outcome), effort)
        dof = len(self.arm.joints)
        return FreePath(done.path(dof), done.control(dof), done.shares(), effort)

    def sphere_centres(self, positions: ArrayLike) -> NDArray[np.float32]:
        """(rows, spheres, 3) [m] in the base, in the order of the trees: for tests and pictures."""
        return motion.centres(self._scene.world, self._kernel, self._rows(positions))

    def _span(self, start: Array, goals: Array) -> tuple[Array, Array]:
        """Where is searched: within the limits, and where a joint has none, half a turn around `start` (n,) and `goals`
        (m, n)."""
        if self._is_limited:
            return self._lower, self._upper
        ends = np.vstack((start, goals))
        around = ends.min(axis=0) - math.pi, ends.max(axis=0) + math.pi
        is_finite = np.isfinite(self._lower), np.isfinite(self._upper)
        return np.where(is_finite[0], self._lower, around[0]), np.where(is_finite[1], self._upper, around[1])

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
        world, margin = self._scene.world, self.margin
        return motion.look(world, self._kernel, rows, degree, margin, FINEST, math.inf, None)[0] == FREE
