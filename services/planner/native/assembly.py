"""The compiled model of one arm, put together anew whenever what stands around it or what it holds changes."""

from __future__ import annotations

import hashlib
import logging
import math
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, Value, because, remedy
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.collision_geometry.shapes import Attachment, CollisionShape, ShapeKind, TriangleMesh
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.chain import frames_of, transform_row
from gemelo.services.planner.native.distance_tables import JointsBetween, PairTable
from gemelo.services.planner.native.sphere_cover import BULGE, SphereCover, cover_shapes, link_cover, longest_side

Array = NDArray[np.float64]

log = logging.getLogger(__name__)

# Tuning constants: chosen, where a line does not say measured or standard.
ATTACHED_SHARE = 1.0 / 40.0  # of an attached thing's longest side may be bulge: it is covered while somebody waits
WIDE = 25.0  # parts of a link's longest side: spheres that reach farther beyond its shapes are said
OBSTACLES = 64  # the first obstacle's number in a contact: kMaxParts
HAIR = 1e-4  # [m] a sphere's least radius; chosen: a smaller one adds a check and no safety
ROUNDING = 2e-5  # [m] for every metre of reach: a float has 24 bits; measured: native/README.md


@dataclass(frozen=True)
class HeldPart:
    """An attachment and its compiled part, and what is surely in it."""

    attachment: Attachment
    cover: SphereCover
    part: motion.Part
    core: motion.Part | None


class NamedPart(NamedTuple):
    """A part of the world: a link, or what is attached to one."""

    name: str
    link: str
    part: motion.Part


class Bodies(NamedTuple):
    """The arm with what it holds: `core` of the spheres less what they bulge, as far as anything is left of them."""

    names: tuple[str, ...]  # of the parts: links, then what is attached
    whole: motion.Body
    core_names: tuple[str, ...]
    core: motion.Body | None


class StandingObstacle(NamedTuple):
    """A shape and its obstacle; `touching` has a bit for every part that may touch it."""

    shape: CollisionShape
    touching: int
    compiled: motion.Obstacle


@dataclass(frozen=True)
class CompiledScene:
    """One state of the surroundings, and the names that belong to it; never changed."""

    world: motion.World
    names: tuple[str, ...]  # of the parts: links, then what is attached
    shapes: tuple[CollisionShape, ...]
    held: Mapping[str, HeldPart]
    cores: motion.World | None  # of the spheres less what they bulge: what touches these surely touches

    def name_of(self, number: int) -> str:
        """Of a part or an obstacle, by its number in a contact."""
        return self.shapes[number - OBSTACLES].name if number >= OBSTACLES else self.names[number]


class Assembly:
    """Everything about the arm that does not change with its surroundings; `covers` are in the links' frames."""

    def __init__(self, arm: ArmDescription, bulge: float) -> None:
        self.arm = arm
        shapes = link_shapes(arm)
        self.covers = {link: _told_cover(arm, link, shapes, bulge) for link in shapes}
        self._frames = frames_of(arm)
        self._chain = motion.chain(self._frames.links, self._frames.numbers, len(arm.joints))
        self._links: dict[str, motion.Part] = {}
        self._cores: dict[str, motion.Part | None] = {}
        self.contents = {link: _digest(shapes[link]) for link in shapes}
        self._tables: tuple[PairTable, ...] = ()
        self._standing: dict[int, StandingObstacle] = {}  # of the newest scene, by the shape's identity
        for link, cover in self.covers.items():
            self._links[link], self._cores[link] = self._part_and_core(link, shapes[link], cover)
        self._alone = self._bodies({})

    @property
    def joints_between(self) -> list[JointsBetween]:
        """Of every pair of links that is checked."""
        names = self._alone.names
        return [
            JointsBetween(
                names[one], names[other], {drive: reach for drive, reach in enumerate(reaches) if reach > 0.0}
            )
            for one, other, reaches in motion.reaches_between(self._alone.whole)
        ]

    def set_tables(self, tables: Sequence[PairTable]) -> None:
        """What links keep at least, read before their spheres from the next scene on."""
        self._tables = tuple(tables)
        self._alone = self._bodies({})

    def hold(self, attachment: Attachment) -> HeldPart:
        """The attachment with its spheres; raises ValueError for an unknown link or a shape without an end."""
        if attachment.link not in self._frames.places:
            raise ValueError(f'"{attachment.name}": {self.arm.name} has no link "{attachment.link}"')
        if attachment.name in self._links:
            raise ValueError(f'"{attachment.name}" is the name of a link; give what is attached another one')
        cover = cover_shapes(attachment.shapes, _bulge(attachment.shapes))
        return HeldPart(attachment, cover, *self._part_and_core(attachment.link, attachment.shapes, cover))

    def compiled_scene(self, shapes: Sequence[CollisionShape], held: Mapping[str, HeldPart]) -> CompiledScene:
        """Links, then what is attached; raises ValueError for two obstacles of one name or an unknown name. Obstacles
        that stood in the scene before are made no second time."""
        _require_distinct(shapes)
        bodies = self._bodies(held) if held else self._alone
        _require_known(shapes, bodies.names)
        around = self._surroundings(shapes, bodies.names)
        world, sure = motion.world(bodies.whole, around), None
        if bodies.core is not None:
            is_same = bodies.core_names == bodies.names or not any(shape.touching for shape in shapes)
            sure = motion.world(bodies.core, around if is_same else self._surroundings(shapes, bodies.core_names))
        return CompiledScene(world, bodies.names, tuple(shapes), dict(held), sure)

    def _surroundings(self, shapes: Sequence[CollisionShape], names: tuple[str, ...]) -> motion.Surroundings:
        """The shapes as they are for a world whose parts have these names."""
        known, standing = self._standing, dict[int, StandingObstacle]()
        for shape in shapes:
            bits = _bits(shape, names) if shape.touching else 0
            before = known.get(id(shape))
            if before is None or before.touching != bits:
                before = StandingObstacle(shape, bits, placed_obstacle_of(shape, bits))
            standing[id(shape)] = before
        self._standing = standing
        return motion.surroundings([each.compiled for each in standing.values()])

    def _bodies(self, held: Mapping[str, HeldPart]) -> Bodies:
        """The arm, and what it holds, with whole spheres and with what surely is in them."""
        parts = [NamedPart(link, link, part) for link, part in self._links.items()]
        parts += [NamedPart(name, one.attachment.link, one.part) for name, one in held.items()]
        cores = [NamedPart(link, link, core) for link, core in self._cores.items() if core is not None]
        cores += [NamedPart(name, one.attachment.link, one.core) for name, one in held.items() if one.core is not None]
        names, core_names = tuple(part.name for part in parts), tuple(core.name for core in cores)
        tables = [
            motion.pair_table(
                names.index(table.first), names.index(table.second), np.array([axis.row for axis in table.axes]),
                np.ascontiguousarray(table.bounds),
            )
            for table in self._tables
        ]  # fmt: skip
        return Bodies(
            names, self._body(parts, held, tables), core_names, self._body(cores, held, []) if cores else None
        )

    def _body(
        self, parts: Sequence[NamedPart], held: Mapping[str, HeldPart], tables: list[motion.PairTable]
    ) -> motion.Body:
        """With the pairs, places of the parts, that are checked against each other."""
        pairs = [
            (first, second)
            for first in range(len(parts))
            for second in range(first + 1, len(parts))
            if self._is_checked(parts[first], parts[second], held)
        ]
        both = np.array(pairs, dtype=np.int32).reshape(-1, 2)
        return motion.body(self._chain, [part.part for part in parts], both, tables)

    def _part_and_core(
        self, link: str, shapes: Sequence[CollisionShape], cover: SphereCover
    ) -> tuple[motion.Part, motion.Part | None]:
        """A link's solids in its frame with their spheres, larger by what floats lose on an arm of this reach; and with
        spheres that are wholly inside the link's shapes whatever floats lose, None if there are none: its largest
        sphere reaches no deeper than the spheres may bulge."""
        frame, pose = self._frames.places[link]
        rounding = self._rounding()
        solids = [obstacle_of(shape, pose @ shape.matrix, rounding) for shape in shapes]

        def with_spheres(covering: Array, wider: float) -> motion.Part:
            spheres = covering.copy()
            spheres[:, :3] = spheres[:, :3] @ pose[:3, :3].T + pose[:3, 3]
            spheres[:, 3] += wider
            return motion.part(frame, np.ascontiguousarray(spheres), solids)

        less = cover.bulge + rounding
        deep = cover.spheres[cover.spheres[:, 3] > less + HAIR]
        return with_spheres(cover.spheres, rounding), with_spheres(deep, -less) if len(deep) else None

    def _rounding(self) -> float:
        """[m] at most between where a float and where a real number is."""
        steps = np.linalg.norm(self._frames.numbers[:, 9:12], axis=1)
        return ROUNDING * max(1.0, float(steps.sum() + self._frames.numbers[:, 14].sum()))

    def _is_checked(self, one: NamedPart, other: NamedPart, held: Mapping[str, HeldPart]) -> bool:
        """True for two parts that a joint can move apart; an attachment says itself what it touches."""
        (name, link, _), (second_name, second_link, _) = one, other
        if self._frames.places[link][0] == self._frames.places[second_link][0]:
            return False
        for attached, touched in ((name, second_name), (second_name, name)):
            if attached in held and touched in held[attached].attachment.touching:
                return False
        if name in held or second_name in held:
            return True
        return not self.arm.collisions_are_disabled(link, second_link)


def _told_cover(
    arm: ArmDescription, link: str, shapes: Mapping[str, Sequence[CollisionShape]], bulge: float
) -> SphereCover:
    """The link's spheres; what takes long, and what reaches far beyond the shapes, is said in the log."""
    several, number = shapes[link], list(shapes).index(link) + 1
    triangles = sum(len(shape.mesh.faces) for shape in several if shape.mesh is not None)
    place = f'{arm.name}, link "{link}" ({number} of {len(shapes)})'
    if triangles:
        log.info("%s: spheres around %d triangles ...", place, triangles)
    began = time.monotonic()
    cover = link_cover(several, bulge)
    if triangles:
        log.info("%s: %d spheres after %.1f s", place, len(cover.spheres), time.monotonic() - began)
    said = wide_spheres(arm, link, several, cover, bulge)
    if said is not None:
        log.warning("%s: %s", place, said)
    return cover


def wide_spheres(
    arm: ArmDescription, link: str, shapes: Sequence[CollisionShape], cover: SphereCover, bulge: float
) -> Reason | None:
    """What it means that a link's spheres reach far beyond its shapes, more than the `bulge` [m] that is usual; None
    where they do not, and for one simple shape."""
    is_mesh = any(shape.kind is ShapeKind.MESH for shape in shapes)
    if cover.bulge <= max(2.0 * bulge, longest_side(shapes) / WIDE) or (len(shapes) == 1 and not is_mesh):
        return None
    named, wider = {"folder": str(arm.folder), "link": link}, math.ceil(1000.0 * cover.bulge)
    figures: dict[str, Value] = {"spheres": len(cover.spheres), "reach": cover.bulge, "usual": bulge}
    if is_mesh:
        return because("trial.link.mesh", remedy("fit_mesh", **named), **figures)
    if any(each.name == link and any(visual.mesh for visual in each.visuals) for each in arm.model.links):
        would_do = remedy("fit_wider", **named, within=f"{wider}mm")
        return because("trial.link.shapes", would_do, **figures, shapes=len(shapes))
    return because("trial.link.shapes", remedy("fewer_shapes"), **figures, shapes=len(shapes))


def _digest(shapes: Sequence[CollisionShape]) -> bytes:
    """The hash of a link's shapes."""
    digest = hashlib.sha256()
    for shape in shapes:
        digest.update(repr((shape.kind, shape.size, shape.pose, shape.padding)).encode())
        for array in shape.mesh.arrays if shape.mesh is not None else ():
            digest.update(array.tobytes())
    return digest.digest()


def _require_distinct(shapes: Sequence[CollisionShape]) -> None:
    if len({shape.name for shape in shapes}) == len(shapes):
        return
    [(name, _)] = Counter(shape.name for shape in shapes).most_common(1)
    raise ValueError(f'the scene has "{name}" twice')


def _require_known(shapes: Sequence[CollisionShape], names: Sequence[str]) -> None:
    for shape in shapes:
        for name in shape.touching:
            if name not in names:
                raise ValueError(f'"{name}" is neither a link with a collision shape nor attached: {", ".join(names)}')


def _bits(shape: CollisionShape, names: Sequence[str]) -> int:
    """A bit for each of these parts that may touch the shape."""
    return sum(1 << names.index(name) for name in shape.touching if name in names)


def _bulge(shapes: Sequence[CollisionShape]) -> float:
    """[m]: more for what is large."""
    longest = [max(shape.size, default=0.0) for shape in shapes]
    longest += [float(np.ptp(shape.mesh.vertices, axis=0).max()) for shape in shapes if shape.mesh is not None]
    return max(BULGE, ATTACHED_SHARE * max(longest, default=0.0))


def placed_obstacle_of(shape: CollisionShape, touching: int = 0) -> motion.Obstacle:
    """The shape where its own pose says; `touching` has a bit for every part that may touch it."""
    number, size, radius = _form(shape)
    compiled = None if shape.mesh is None else _compiled(shape.mesh)
    return motion.placed_obstacle(number, *shape.pose, size, radius + shape.padding, touching, compiled)


def obstacle_of(shape: CollisionShape, pose: Array, padding: float = 0.0) -> motion.Obstacle:
    """The shape at `pose` (4, 4), larger by `padding` [m]."""
    number, size, radius = _form(shape)
    compiled = None if shape.mesh is None else _compiled(shape.mesh)
    around = radius + shape.padding + padding
    return motion.obstacle(number, transform_row(pose), np.array(size), around, 0, compiled)


@lru_cache(maxsize=64)
def _compiled(mesh: TriangleMesh) -> motion.TriangleMesh:
    """Built once for as long as it is among the newest: the costly part of a mesh."""
    return motion.mesh(*mesh.arrays)


def _form(shape: CollisionShape) -> tuple[int, tuple[float, float, float], float]:
    """Number, size and radius as views.h has them: what is round is a point, a line or a box with a radius."""
    size = shape.size
    match shape.kind:
        case ShapeKind.BOX:
            return 0, (0.5 * size[0], 0.5 * size[1], 0.5 * size[2]), 0.0
        case ShapeKind.SPHERE:
            return 0, (0.0, 0.0, 0.0), size[0]
        case ShapeKind.CAPSULE:
            return 0, (0.0, 0.0, 0.5 * size[1]), size[0]
        case ShapeKind.CYLINDER:
            return 1, (size[0], 0.0, 0.5 * size[1]), 0.0
        case ShapeKind.HALF_SPACE:
            return 2, (0.0, 0.0, 0.0), 0.0
        case ShapeKind.MESH | ShapeKind.HULL:
            return 3, (0.0, 0.0, 0.0), 0.0
