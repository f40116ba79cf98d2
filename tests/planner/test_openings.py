"""Openings of a mesh that is made for the eye: with a lid, shapes need not follow its inside."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest
import trimesh

from gemelo.services.planner.collision_geometry.coal_shapes import is_inside
from gemelo.services.planner.collision_geometry.shapes import TriangleMesh
from gemelo.tools.bench.fit_quality import heavy_part
from gemelo.tools.collision_fitting import mesh_fit
from gemelo.tools.collision_fitting.excess import SHARE, depth_in, excess_of
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface
from gemelo.tools.collision_fitting.openings import closed
from gemelo.tools.collision_fitting.parts import shapes_around

WITHIN = 0.005


def as_mesh(made: trimesh.Trimesh) -> TriangleMesh:
    return TriangleMesh(np.array(made.vertices), np.array(made.faces, dtype=np.int32))


def cup(sections: int = 64) -> trimesh.Trimesh:
    """A cylinder without its bottom."""
    made = trimesh.creation.cylinder(0.05, 0.1, sections=sections).subdivide()
    made.update_faces(~(made.triangles[:, :, 2] < -0.0499).all(axis=1))
    return made


def test_a_cup_gets_a_lid_and_one_shape_that_holds_what_is_behind_it():
    mesh = as_mesh(cup())
    surface = MeshSurface(mesh)
    shapes = shapes_around(surface, WITHIN, 40)
    assert len(shapes) == 1
    assert excess_of(shapes, surface, WITHIN).share >= SHARE
    assert depth_in(shapes[0].shapes, np.array([[0.0, 0.0, -0.0499]]))[0] > 0.0
    assert is_inside(closed(mesh), np.array([0.0, 0.0, -0.0499]))


def test_a_surface_with_a_front_and_a_back_has_each_triangle_once_and_an_inside():
    made = trimesh.creation.icosphere(3, 0.05)
    both = TriangleMesh(np.array(made.vertices), np.vstack((made.faces, made.faces[:, ::-1])).astype(np.int32))
    once = closed(both)
    assert len(once.faces) == len(made.faces)
    assert is_inside(once, np.zeros(3))
    assert not is_inside(both, np.zeros(3))


def test_a_closed_mesh_stays_as_it_is():
    made = trimesh.util.concatenate([trimesh.creation.box((0.1, 0.1, 0.1)), trimesh.creation.torus(0.2, 0.02)])
    assert len(closed(as_mesh(made)).faces) == len(made.faces)


def test_pieces_that_are_not_joined_get_no_lids():
    corners = trimesh.creation.box((0.1, 0.1, 0.1)).triangles
    apart = TriangleMesh(
        corners.reshape(-1, 3) + 1e-6 * np.arange(36)[:, None], np.arange(36, dtype=np.int32).reshape(-1, 3)
    )
    assert len(closed(apart).faces) == 12


def test_the_seam_of_two_halves_with_corners_of_their_own_is_no_opening():
    halves = []
    for sections, turn in ((64, 0.0), (64, 0.02)):
        half = cup(sections).subdivide()
        half.apply_transform(trimesh.transformations.rotation_matrix(turn, (0.0, 0.0, 1.0)))
        halves.append(half)
    assert len(closed(as_mesh(halves[0])).faces) > len(halves[0].faces)
    halves[1].apply_transform(trimesh.transformations.rotation_matrix(np.pi, (1.0, 0.0, 0.0), (0.0, 0.0, -0.05)))
    both = trimesh.util.concatenate(halves)
    assert len(closed(as_mesh(both)).faces) == len(both.faces)


def test_the_edge_of_a_bent_sheet_is_no_opening():
    made = trimesh.creation.cylinder(0.05, 0.1, sections=64).subdivide().subdivide()
    made.update_faces(
        (made.triangles[:, :, 0].mean(axis=1) > 0.0) & (np.abs(made.triangles[:, :, 2]).min(axis=1) < 0.049)
    )
    assert len(closed(as_mesh(made)).faces) == len(made.faces)


def test_a_heavy_mesh_with_all_that_cad_draws_needs_few_shapes():
    """The link of `import_s`: an open housing with a front and a back, a motor, a hundred bolts."""
    made = heavy_part(0)
    mesh = TriangleMesh(np.array(made.vertices) / 1000.0, np.array(made.faces, dtype=np.int32))
    assert len(mesh.faces) >= 60_000
    surface = MeshSurface(mesh)
    shapes = shapes_around(surface, WITHIN, 40)
    assert len(shapes) <= 5
    assert excess_of(shapes, surface, WITHIN).share >= SHARE
    assert depth_in([shape for each in shapes for shape in each.shapes], mesh.vertices).min() >= -1e-9


@pytest.mark.parametrize("alone", [0.0, 1e9])
def test_links_are_fitted_alike_by_one_process_and_by_several(alone: float, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(mesh_fit, "ALONE", {"spawn": alone, "fork": alone})
    wanted = [(name, as_mesh(cup(sections)), WITHIN, 4) for name, sections in (("a", 24), ("b", 32), ("c", 48))]
    found = [fit for fit, _ in mesh_fit.fit_on_all_cores(wanted)]
    assert [fit.link for fit in found] == ["a", "b", "c"]
    assert [fit.shapes for fit in found] == [mesh_fit.fit_link(*each).shapes for each in wanted]


FORKED = """
import numpy as np
from gemelo.tools.collision_fitting import mesh_fit
from tests.planner.test_openings import as_mesh, cup
mesh_fit.ALONE["fork"] = 0.0
wanted = [(name, as_mesh(cup(sections)), mesh_fit.WITHIN, 4) for name, sections in (("a", 24), ("b", 32))]
found = [fit for fit, _ in mesh_fit.fit_on_all_cores(wanted)]
assert [fit.shapes for fit in found] == [mesh_fit.fit_link(*each).shapes for each in wanted]
print(mesh_fit.start_method())
"""


def test_only_a_process_without_other_threads_forks_and_fits_alike():
    done = subprocess.run([sys.executable, "-c", FORKED], check=True, stdout=subprocess.PIPE, text=True)
    assert done.stdout.strip() == ("fork" if sys.platform == "linux" else "spawn")
    stop = threading.Event()
    other = threading.Thread(target=stop.wait)
    other.start()
    assert mesh_fit.start_method() == "spawn"
    stop.set()
    other.join()
