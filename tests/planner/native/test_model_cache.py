"""Spheres of meshes on the disk: made once, shared by processes, made again where they are damaged."""

from __future__ import annotations

import logging
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics import self_collisions
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.stl import read_stl
from gemelo.schemas.reasons import remedy
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes, solid_of
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh
from gemelo.services.planner.core import Planner
from gemelo.services.planner.native import model_cache, sphere_cover
from gemelo.services.planner.native.assembly import wide_spheres
from gemelo.services.planner.native.model_cache import FOLDER, cache_folder, cached_rows
from gemelo.services.planner.native.native_planner import NativePlanner
from gemelo.services.planner.native.sphere_cover import SphereCover, kept_cover
from gemelo.services.planner.trial import trial
from tests.arm.plates import add_plate
from tests.disks import refusing_disk
from tests.planner.test_world import stl_box

BULGE = 0.02  # [m]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER, str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """A number for every time that spheres are made."""
    times: list[int] = []
    make = sphere_cover.mesh_cover

    def counted(*arguments: object) -> object:
        times.append(len(times))
        return make(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(sphere_cover, "mesh_cover", counted)
    return times


def cube(half: float = 0.05) -> CollisionShape:
    triangles = read_stl(stl_box(half))
    return CollisionShape("cube", ShapeKind.MESH, mesh=TriangleMesh(triangles.vertices, triangles.faces))


def test_equal_meshes_are_covered_once_and_alike(made: list[int]):
    first, second = kept_cover(cube(), BULGE), kept_cover(cube(), BULGE)
    fresh = sphere_cover.mesh_cover(*cube().mesh.arrays, BULGE)  # type: ignore[union-attr]
    assert made == [0, 1]  # the second one is this test's own
    for cover in (first, second):
        assert np.array_equal(cover.spheres, fresh.spheres)
        assert cover.bulge == fresh.bulge


def test_another_mesh_or_bulge_or_maker_is_another_model(made: list[int], monkeypatch: pytest.MonkeyPatch):
    kept_cover(cube(), BULGE)
    kept_cover(cube(0.06), BULGE)
    kept_cover(cube(), 2.0 * BULGE)
    monkeypatch.setattr(model_cache, "maker", lambda: b"compiled anew")
    kept_cover(cube(), BULGE)
    assert len(made) == 4


@pytest.mark.parametrize("damage", ["", "short", "one bit"])
def test_a_damaged_file_is_made_again(made: list[int], folder: Path, damage: str, caplog: pytest.LogCaptureFixture):
    expected = kept_cover(cube(), BULGE)
    (file,) = folder.glob("*.rows")
    content = bytearray(file.read_bytes())
    content[-3] ^= 4
    file.write_bytes({"": b"", "short": bytes(content[:50]), "one bit": bytes(content)}[damage])
    again = kept_cover(cube(), BULGE)
    assert np.array_equal(again.spheres, expected.spheres)
    assert f"{file} is damaged" in caplog.text
    kept_cover(cube(), BULGE)
    assert len(made) == 2


def test_who_comes_at_the_same_time_waits_and_makes_nothing(folder: Path):
    """Processes and threads alike: whoever opens the lock has it alone."""
    made: list[int] = []

    def make() -> np.ndarray:
        made.append(1)
        return np.arange(4.0 * 5000).reshape(-1, 4)

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: cached_rows(b"the same", make), range(8)))
    assert all(np.array_equal(rows, found[0]) for rows in found)
    assert len(made) == 1
    assert [file.suffix for file in folder.iterdir() if file.suffix != ".lock"] == [".rows"]


def test_a_folder_that_cannot_be_written_is_no_reason_not_to_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: list[int], caplog: pytest.LogCaptureFixture
):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(FOLDER, str(tmp_path / "file"))
    assert len(kept_cover(cube(), BULGE).spheres) > 0
    assert "cannot be written" in caplog.text
    assert made == [0]


def test_a_full_disk_keeps_no_part_of_a_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    with refusing_disk("full", tmp_path / "cache") as disk:
        monkeypatch.setenv(FOLDER, str(disk.folder))
        disk.refuse()
        rows = cached_rows(b"content", lambda: np.ones((5000, 4)))
        assert rows.shape == (5000, 4)
        assert "cannot be written (No space left on device)" in caplog.text
        assert [path.name for path in disk.folder.iterdir()] == ["ballast"]


def test_the_folder_is_the_platforms_where_none_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.delenv(FOLDER)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "gemelo"


def test_only_so_many_files_are_kept(monkeypatch: pytest.MonkeyPatch, folder: Path):
    monkeypatch.setattr(model_cache, "MOST_FILES", 3)
    for number in range(6):
        cached_rows(bytes([number]), lambda: np.zeros((1, 4)))
    assert len(list(folder.glob("*.rows"))) == 3


def test_a_solid_is_covered_once_too_and_as_it_would_be_anew(folder: Path, monkeypatch: pytest.MonkeyPatch):
    box = CollisionShape("box", ShapeKind.BOX, (0.1, 0.07, 0.05))
    fresh = sphere_cover.cover_of(solid_of(box), 0.011)
    kept_cover(box, 0.011)
    sphere_cover.kept_solid.cache_clear()
    monkeypatch.setattr(sphere_cover, "cover_of", None)
    again = kept_cover(box, 0.011)
    assert np.array_equal(again.spheres, fresh.spheres)
    assert again.bulge == fresh.bulge


def test_the_shapes_of_an_arm_are_read_once_and_their_triangles_too(
    meshed: ArmDescription, monkeypatch: pytest.MonkeyPatch
):
    read = self_collisions.read_collision_geometry
    times: list[ArmDescription] = []

    def counted(arm: ArmDescription, model: object) -> object:
        times.append(arm)
        return read(arm, model)

    monkeypatch.setattr(self_collisions, "read_collision_geometry", counted)
    arm = load_arm(meshed.folder)
    Planner(arm).prepare()
    assert times == [arm]
    meshes = [shape.mesh for shapes in link_shapes(arm).values() for shape in shapes if shape.mesh is not None]
    assert len(meshes) == 2
    assert meshes[0] is meshes[1]


@pytest.fixture
def meshed(rm1_folder: Path, tmp_path: Path) -> ArmDescription:
    """rm1 with a mesh on two links."""
    shutil.copytree(rm1_folder, tmp_path / "rm1")
    (tmp_path / "rm1" / "cube.stl").write_bytes(stl_box(0.02))
    add_plate(tmp_path / "rm1", "low_cube", "base_link", 0.0, -0.6, '<mesh filename="cube.stl"/>')
    add_plate(tmp_path / "rm1", "arm_cube", "brazo_link", 0.0, 0.6, '<mesh filename="cube.stl"/>')
    return load_arm(tmp_path / "rm1")


def test_another_process_finds_what_the_first_has_made(meshed: ArmDescription, made: list[int], folder: Path):
    program = (
        "import sys; from pathlib import Path; from gemelo.libraries.arm.model.description import load_arm; "
        "from gemelo.services.planner.native.native_planner import NativePlanner; "
        "NativePlanner(load_arm(Path(sys.argv[1])))"
    )
    subprocess.run([sys.executable, "-c", program, str(meshed.folder)], check=True)
    there = set(folder.iterdir())
    assert any(file.suffix == ".rows" for file in there)
    sphere_cover.kept_solid.cache_clear()
    NativePlanner(meshed)
    assert made == []
    assert set(folder.iterdir()) == there  # nor the boxes' and cylinders' spheres


def test_the_log_says_how_far_it_is_and_which_model_is_too_large(
    meshed: ArmDescription, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr("gemelo.services.planner.native.sphere_cover.MOST_SPHERES", 1)
    with caplog.at_level(logging.INFO):
        NativePlanner(meshed)
    assert 'link "low_cube" (6 of 6): spheres around 12 triangles ...' in caplog.text
    assert 'link "arm_cube" (5 of 6): spheres around 12 triangles ...' in caplog.text
    assert 'link "brazo_link" (2 of 6): its collision model is 4 shapes, whose' in caplog.text
    assert f"`gemelo collision fit {meshed.folder} --meshes --link brazo_link --within" in caplog.text


def test_the_trial_names_a_model_that_is_too_large_with_the_remedy(
    meshed: ArmDescription, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("gemelo.services.planner.native.sphere_cover.MOST_SPHERES", 1)
    found = [finding for finding in trial(meshed, 0.0) if finding.subject == 'link "brazo_link"']
    assert len(found) == 1
    assert "spheres reach" in found[0].message
    assert "gemelo collision fit" in found[0].remedy


def sliced(count: int) -> list[CollisionShape]:
    """So many plates of a link of 2 m, side by side."""
    places = np.linspace(-1.0, 1.0, count)
    return [
        CollisionShape("plate", ShapeKind.BOX, (2.0, 2.0 / count, 2.0), ((0.0, y, 0.0), (0.0, 0.0, 0.0, 1.0)))
        for y in places
    ]


def test_the_remedy_for_too_many_fitted_shapes_is_fewer_of_them_and_for_one_shape_there_is_none(meshed: ArmDescription):
    bulge, link = 0.1, "base_link"
    wide = SphereCover(np.zeros((1500, 4)), bulge)
    many = wide_spheres(meshed, link, sliced(20), wide, 0.005)
    assert many is not None
    assert many.code == "trial.link.shapes"
    assert many.values == {"spheres": 1500, "reach": bulge, "usual": 0.005, "shapes": 20}
    assert many.remedies == (remedy("fit_wider", folder=str(meshed.folder), link=link, within="100mm"),)
    raw = wide_spheres(meshed, link, [*sliced(1), cube()], wide, 0.005)
    assert raw is not None
    assert raw.code == "trial.link.mesh"
    assert raw.remedies == (remedy("fit_mesh", folder=str(meshed.folder), link=link),)
    assert wide_spheres(meshed, link, sliced(1), wide, 0.005) is None
    assert wide_spheres(meshed, link, sliced(20), SphereCover(wide.spheres, 0.03), 0.005) is None
