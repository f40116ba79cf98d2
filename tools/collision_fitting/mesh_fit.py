"""Collision shapes for an arm that has only meshes: fitted to what each link looks like."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from gemelo.libraries.arm.errors import DescriptionError, nearest
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.collision_geometry.shapes import TriangleMesh
from gemelo.tools.collision_fitting.excess import SHARE, Excess, excess_of
from gemelo.tools.collision_fitting.fitted_shape import Fitted
from gemelo.tools.collision_fitting.link_meshes import link_mesh
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface
from gemelo.tools.collision_fitting.parts import shapes_around

# Tuning constants: chosen, where a line does not say measured or standard.
WITHIN = 0.005  # [m] of the mesh, where `SHARE` of the shapes' outer surface is to be
WITHIN_SHARE = 0.01  # of the longest side of a link for which that is more
MOST = 40  # shapes of a link
# [s] of the CPU, after which other processes are started: a spawned one loads all libraries anew, for some 4 s, and a
# forked one has them.
ALONE = {"spawn": 8.0, "fork": 0.5}

WantedFit = tuple[str, TriangleMesh, float, int]  # what `fit_link` is given


@dataclass(frozen=True)
class LinkFit:
    """The shapes around one link's mesh, and how far they reach beyond it; `within` [m] was asked for."""

    link: str
    mesh: TriangleMesh
    shapes: tuple[Fitted, ...]
    within: float
    excess: Excess

    @property
    def is_within(self) -> bool:
        """True if as much of the surface as is to be is within the bound."""
        return self.excess.share >= SHARE


def _tell_nobody(_: Reason) -> None:
    pass


def fit_links(
    arm: ArmDescription,
    within: float | None = None,
    most: int = MOST,
    only: Sequence[str] = (),
    tell: Callable[[Reason], None] = _tell_nobody,
) -> list[LinkFit]:
    """Of every link with a visual mesh, or of those named, to within so many [m], or to what is usual for its size;
    `tell` gets what was fitted to each link. Raises `DescriptionError` with what is wrong and where."""
    for name in only:
        if name not in arm.model.link_names:
            hint = nearest(name, arm.model.link_names)
            raise DescriptionError(because("fit.no_link", hint, file=str(arm.urdf_path), link=name))
    wanted = [link for link in arm.model.links if not only or link.name in only]
    meshes = {link.name: link_mesh(link, arm.urdf_path.parent) for link in wanted}
    bare = [name for name in only if meshes[name] is None]
    if bare or not any(meshes.values()):
        if bare:
            raise DescriptionError(because("fit.link.no_visual", file=str(arm.urdf_path), link=bare[0]))
        raise DescriptionError(because("fit.no_visual", file=str(arm.urdf_path)))
    drawn = {name: mesh for name, mesh in meshes.items() if mesh is not None}
    fits = []
    wanted_fits = [(name, mesh, usual_bound(mesh) if within is None else within, most) for name, mesh in drawn.items()]
    for fit, seconds in fit_on_all_cores(wanted_fits):
        fits.append(fit)
        tell(_progress(fit, (len(fits), len(drawn)), seconds))
    return fits


def _progress(fit: LinkFit, place: tuple[int, int], seconds: float) -> Reason:
    """What was fitted to the link at that `place`, its number and how many there are, in so many seconds."""
    number, count = place
    shapes = because("fit.shape.one") if len(fit.shapes) == 1 else because("fit.shape.several", count=len(fit.shapes))
    reach = {"p95": 1000.0 * fit.excess.p95, "worst": 1000.0 * fit.excess.worst}
    triangles = len(fit.mesh.faces)
    return because(
        "fit.progress", shapes, link=fit.link, number=number, of=count, triangles=triangles, time=seconds, **reach
    )


def fit_on_all_cores(wanted: Sequence[WantedFit]) -> Iterator[tuple[LinkFit, float]]:
    """Each fit with how long it took [s], in their order; in processes of their own once they have taken `ALONE`."""
    began, number, method = time.process_time(), 0, start_method()
    while number < len(wanted) and time.process_time() < began + ALONE[method]:
        yield _timed_fit(wanted[number])
        number += 1
    if number < len(wanted):
        count = min(len(wanted) - number, os.cpu_count() or 1)
        with ProcessPoolExecutor(count, get_context(method)) as others:
            yield from others.map(_timed_fit, wanted[number:])


def start_method() -> str:
    """Forked only as on the command line: what other threads, also Zenoh's own, have locked stays so in a fork."""
    is_alone = threading.active_count() == 1 and "zenoh" not in sys.modules
    return "fork" if is_alone and sys.platform == "linux" else "spawn"


def _timed_fit(wanted: WantedFit) -> tuple[LinkFit, float]:
    began = time.monotonic()
    return fit_link(*wanted), time.monotonic() - began


def usual_bound(mesh: TriangleMesh) -> float:
    """[m] `WITHIN`, more for a link that is longer than half a metre."""
    return max(WITHIN, WITHIN_SHARE * float(np.ptp(mesh.vertices, axis=0).max()))


def fit_link(link: str, mesh: TriangleMesh, within: float, most: int) -> LinkFit:
    """`most` shapes at the most around the mesh of a link, to within so many [m]."""
    surface = MeshSurface(mesh)
    shapes = tuple(shapes_around(surface, within, most))
    return LinkFit(link, mesh, shapes, within, excess_of(shapes, surface, within))


def beyond_bound(fit: LinkFit, most: int) -> Reason:
    """That the bound was not met with so many shapes at most, by how much, where, and what would do."""
    excess, within = fit.excess, math.ceil(1000.0 * fit.excess.p95)
    would_do = remedy("fit_looser", within=within)
    if len(fit.shapes) >= most:
        would_do = remedy("fit_more_shapes", most=2 * most, within=within)
    return because(
        "fit.beyond", would_do,
        link=fit.link, shapes=len(fit.shapes), share=100.0 * excess.share, limit=100.0 * SHARE,
        within=1000.0 * fit.within, p95=1000.0 * excess.p95, worst=1000.0 * excess.worst,
        place=", ".join(f"{1000.0 * value:.0f}" for value in excess.place),
    )  # fmt: skip
