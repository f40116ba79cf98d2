"""Checks of the URDF's meshes: that they open, are in metres, bound a volume, and weigh what the link weighs."""

from __future__ import annotations

import re
from collections.abc import Callable, Container
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import Subject
from gemelo.libraries.arm.model.urdf import Geometry, UrdfLink, UrdfModel
from gemelo.schemas.reasons import Reason, because, remedy

if TYPE_CHECKING:
    import trimesh

# Tuning constants: chosen, where a line does not say measured or standard.
IN_MILLIMETRES = 5.0  # longest side in the file's unit from which on a link's mesh is not in metres
SMALLEST = 0.002  # [m] of its longest side
MOST_TRIANGLES = 500_000  # of a file: beyond it a viewer is slow, and shapes are fitted for minutes
FLAT = 1e-3  # thickness as a share of the longest side below which a mesh bounds no volume
LIGHTEST, HEAVIEST = 15.0, 20_000.0  # [kg/m^3] light foam, tungsten: no part of an arm is beyond
COLLADA_UNIT = re.compile(rb"<unit\b[^>]*?\bmeter\s*=\s*[\"']\s*([0-9.eE+-]+)")
LFS_POINTER, IS_POINTER = b"version https://git-lfs", because("mesh.pointer")
ALONE, MOST_KNOWN = (".stl", ".ply", ".glb"), 256  # formats of one file; of how many files facts are kept
IN_MM = "mesh.millimetres"


@dataclass(frozen=True)
class MeshFacts:
    """What a file holds, in its own unit: its longest and its shortest side, its volume, inertia of density 1, the
    corners of the box along its axes, and how many triangles."""

    longest: float
    thickness: float
    volume: float
    center: tuple[float, ...]  # (3,) of volume
    inertia: tuple[float, ...]  # (9,) of the volume with density 1, about `center`
    low: tuple[float, ...]  # (3,)
    high: tuple[float, ...]  # (3,)
    triangles: int

    @property
    def is_flat(self) -> bool:
        """True if it bounds no volume."""
        return self.thickness < FLAT * self.longest


_KNOWN: dict[tuple[str, bytes], MeshFacts | Reason] = {}  # by format and content
Facts = Callable[[Geometry], MeshFacts | Reason | None]


def mesh_facts(folder: Path) -> Facts:
    """Of the meshes of a robot's folder, each file read once."""
    known: dict[str, MeshFacts | Reason] = {}

    def facts(geometry: Geometry) -> MeshFacts | Reason | None:
        if geometry.mesh is None:
            return None
        if geometry.mesh not in known:
            known[geometry.mesh] = facts_of(folder / geometry.mesh.removeprefix("file://"))
        return known[geometry.mesh]

    return facts


def scene_of(file: Path) -> trimesh.Scene:
    """What a mesh file holds, in its own units; in metres where it names its unit, as COLLADA does and as ROS reads it.

    Raises what trimesh's many readers raise.
    """
    import trimesh  # half a second

    scene = trimesh.load_scene(file)
    if file.suffix.lower() == ".dae":
        unit = COLLADA_UNIT.search(file.read_bytes())
        metres = float(unit[1]) if unit else 1.0
        if metres != 1.0:
            scene.apply_scale(metres)
    return scene


def facts_of(file: Path) -> MeshFacts | Reason:
    """Of a mesh file, or why it cannot be read; a copy of a file that stands alone is not read again."""
    if _is_pointer(file):
        return IS_POINTER
    if file.suffix.lower() not in ALONE or not file.is_file():
        return _read_facts(file)
    key = (file.suffix.lower(), sha256(file.read_bytes()).digest())
    if key not in _KNOWN:
        if len(_KNOWN) >= MOST_KNOWN:
            _KNOWN.clear()
        _KNOWN[key] = _read_facts(file)
    return _KNOWN[key]


def _read_facts(file: Path) -> MeshFacts | Reason:
    try:
        mesh = scene_of(file).to_mesh()
    except ImportError as problem:
        return because("mesh.no_reader", ending=file.suffix, problem=str(problem))
    except Exception as problem:  # whatever its many readers raise for a damaged file
        return because("mesh.unreadable", problem=str(problem)) if str(problem) else because("mesh.damaged")
    if not len(mesh.faces):
        return because("mesh.empty")
    used = np.asarray(mesh.vertices, dtype=float)[np.unique(mesh.faces)]
    if not np.isfinite(used).all():
        return because("mesh.not_finite")
    longest = float(np.ptp(used, axis=0).max())
    box = tuple(used.min(axis=0).tolist()), tuple(used.max(axis=0).tolist()), len(mesh.faces)
    try:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)  # for the volume: exporters write every corner thrice
        whole = mesh if mesh.is_watertight else mesh.convex_hull
        volume, center, inertia = abs(float(whole.volume)), tuple(whole.center_mass), whole.moment_inertia
    except Exception:  # the hull of what is flat, by qhull
        return MeshFacts(longest, 0.0, 0.0, (0.0,) * 3, (0.0,) * 9, *box)
    return MeshFacts(longest, _thickness(used), volume, center, tuple(np.ravel(inertia)), *box)


def _is_pointer(file: Path) -> bool:
    """True for what a clone has in a mesh's place if Git LFS is not installed."""
    if not file.is_file():
        return False
    with file.open("rb") as opened:
        return opened.read(len(LFS_POINTER)) == LFS_POINTER


def _thickness(points: np.ndarray) -> float:
    """Of the points (n, 3) along the axis on which they spread least."""
    across = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    return float(np.ptp(points @ across.T, axis=0).min())


def check_meshes(model: UrdfModel, file: str, facts: Facts, sized: Container[str] = ()) -> list[Finding]:
    """Every mesh once a link; `facts` gives None for what is no mesh or not there, which others say, as they do of the
    size of the meshes `sized`."""
    findings: list[Finding] = []
    for link in model.links:
        seen: set[str | None] = set()
        for geometry in (*link.visuals, *link.collisions):
            if geometry.mesh is not None and geometry.mesh not in seen:
                seen.add(geometry.mesh)
                found = _mesh(geometry, facts(geometry), Subject("link", link.name), file)
                findings += [each for each in found if geometry.mesh not in sized or each.what.code != IN_MM]
        findings += _density(link, file, facts)
    return findings


def is_in_millimetres(geometry: Geometry, facts: MeshFacts) -> bool:
    """True if it is 1000 times too large as it is scaled now."""
    return facts.longest * max(map(abs, geometry.scale)) > IN_MILLIMETRES


def _mesh(geometry: Geometry, facts: MeshFacts | Reason | None, subject: Subject, file: str) -> list[Finding]:
    if facts is None:
        return []
    mesh, line = geometry.mesh or "", geometry.line
    if isinstance(facts, Reason):
        mend = remedy("git_lfs_pull") if facts == IS_POINTER else remedy("export_as_stl")
        return [error(file, subject, because("mesh.wrong", facts, mend, mesh=mesh), line=line)]
    longest = facts.longest * max(map(abs, geometry.scale))
    if is_in_millimetres(geometry, facts):
        mend = remedy("write_line", text='scale="0.001 0.001 0.001"')
        return [error(file, subject, because(IN_MM, mend, mesh=mesh, length=longest), line=line)]
    if longest < SMALLEST:
        what = because("mesh.small", remedy("see_its_scale"), mesh=mesh, length=longest)
        return [warning(file, subject, what, line=line)]
    if facts.is_flat:
        thickness = facts.thickness * max(map(abs, geometry.scale))
        what = because("mesh.flat", remedy("export_the_solid"), mesh=mesh, thickness=thickness)
        return [warning(file, subject, what, line=line)]
    return []


def _density(link: UrdfLink, file: str, facts: Facts) -> list[Finding]:
    """Mass over the volume of the link's meshes; a link with other visuals is not judged."""
    volume = link_volume(link, facts)
    if link.inertial is None or not link.inertial.mass > 0.0 or not volume:
        return []
    density = link.inertial.mass / volume
    if LIGHTEST <= density <= HEAVIEST:
        return []
    mend, mass = remedy("correct_mass_or_unit"), link.inertial.mass
    what = because("mesh.density", mend, mass=mass, volume=1e6 * volume, density=density)
    return [warning(file, Subject("link", link.name), what, line=link.line)]


def link_volume(link: UrdfLink, facts: Facts) -> float:
    """[m^3] of its visual meshes; 0 where one of them is no mesh, flat, in another unit or cannot be read."""
    total = 0.0
    for visual in link.visuals:
        known = facts(visual)
        if not isinstance(known, MeshFacts) or known.is_flat or is_in_millimetres(visual, known):
            return 0.0
        total += known.volume * abs(float(np.prod(visual.scale)))
    return total
