"""Shapes fitted to meshes: they hold every corner, what is inside as well, and no more than they need."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.kinematics.collision_matrix import collision_matrix
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.srdf_edit import with_pairs
from gemelo.libraries.arm.model.urdf_edit import with_collisions
from gemelo.schemas.reasons import because
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision_geometry.coal_shapes import is_inside
from gemelo.services.planner.collision_geometry.link_shapes import link_shapes
from gemelo.services.planner.collision_geometry.shapes import ShapeKind, TriangleMesh
from gemelo.tools.cli.robot.robot_folder import plan_of
from gemelo.tools.collision_fitting import cuts
from gemelo.tools.collision_fitting.excess import SHARE, depth_in, depths
from gemelo.tools.collision_fitting.fit_writing import HULLS, touching_states, write_fits
from gemelo.tools.collision_fitting.fitted_shape import Fitted, FittedKind
from gemelo.tools.collision_fitting.fitting import fitted
from gemelo.tools.collision_fitting.hull import smallest_ball
from gemelo.tools.collision_fitting.link_meshes import visual_mesh
from gemelo.tools.collision_fitting.mesh_fit import fit_links, usual_bound
from gemelo.tools.collision_fitting.mesh_part import MeshPart
from gemelo.tools.collision_fitting.mesh_surface import MeshSurface
from gemelo.tools.collision_fitting.parts import shapes_around
from tests.profiles import examples

URDF = Path(__file__).parents[2] / "urdf"
SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(params=["rm1", "parol6"])
def copied(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A robot that may be changed."""
    shutil.copytree(URDF / request.param, tmp_path / request.param)
    return tmp_path / request.param


def turned(points: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """The same anywhere, in any direction."""
    turn = trimesh.transformations.random_rotation_matrix(random.uniform(size=3))[:3, :3]
    return points @ turn.T + random.uniform(-0.3, 0.3, 3)


def depth(shapes: list[Fitted] | tuple[Fitted, ...], points: np.ndarray) -> np.ndarray:
    """How deep each point is in the shape that holds it best."""
    return np.max([depths(shape, points) for each in shapes for shape in each.shapes], axis=0)


def as_mesh(made: trimesh.Trimesh, points: np.ndarray | None = None) -> TriangleMesh:
    return TriangleMesh(np.array(made.vertices if points is None else points), np.array(made.faces, dtype=np.int32))


@given(SEEDS, st.integers(1, 3), st.integers(1, 60))
@examples(quick=10, full=60)
def test_the_smallest_ball_holds_all_and_no_other_place_needs_less(seed: int, dimension: int, count: int):
    random = np.random.default_rng(seed)
    points = np.round(random.normal(size=(count, dimension)), random.integers(0, 8))  # with some on one place or line
    centre, radius = smallest_ball(points)
    assert np.linalg.norm(points - centre, axis=1).max() <= radius + 1e-12
    for _ in range(20):
        moved = centre + 1e-3 * random.normal(size=dimension)
        assert np.linalg.norm(points - moved, axis=1).max() >= radius - 1e-9


@given(SEEDS, st.sampled_from([kind for kind in FittedKind if kind is not FittedKind.HULL]))
@examples(quick=10, full=40)
def test_what_has_one_of_the_shapes_is_found_to_have_it(seed: int, kind: FittedKind):
    random = np.random.default_rng(seed)
    size, long = random.uniform(0.02, 0.1, 3), random.uniform(0.15, 0.3)
    made = {
        FittedKind.BOX: lambda: trimesh.creation.box(extents=size),
        FittedKind.CYLINDER: lambda: trimesh.creation.cylinder(radius=size[0], height=long, sections=64),
        FittedKind.CAPSULE: lambda: trimesh.creation.capsule(radius=size[0], height=3.0 * size[0], count=(33, 32)),
        FittedKind.PLATE: lambda: (
            trimesh.Scene(
                [
                    trimesh.creation.cylinder(0.03, 0.02, sections=64, transform=np.eye(4) + at * np.eye(4, k=3))
                    for at in (-0.06, 0.06)
                ]
            )
            .to_mesh()
            .convex_hull
        ),
        FittedKind.SPHERE: lambda: trimesh.creation.icosphere(radius=size[0], subdivisions=4),
    }[kind]()
    points = turned(made.vertices, random)
    found = fitted(points)
    assert found.kind is kind
    assert depth([found], points).min() >= 0.0
    assert found.volume < 1.03 * made.volume + 1e-7


@given(SEEDS, st.integers(4, 300), st.floats(0.0, 1.0))
@examples(quick=10, full=60)
def test_whatever_the_points_are_the_shape_holds_them_all(seed: int, count: int, flat: float):
    random = np.random.default_rng(seed)
    points = turned(random.normal(size=(count, 3)) * (0.05, 0.05 * flat, 0.05 * flat**3), random)
    assert depth([fitted(points)], points).min() >= 0.0


@pytest.mark.parametrize("points", [np.zeros((3, 3)), np.eye(3), np.arange(9.0).reshape(3, 3), np.zeros((1, 3))])
def test_points_without_a_volume_get_a_thin_shape(points: np.ndarray):
    found = fitted(points)
    assert depth([found], points).min() >= 0.0
    assert min(found.size) > 0.0


@given(SEEDS)
@examples(quick=2, full=6)
def test_what_is_inside_a_mesh_is_inside_its_shapes_wherever_it_was_cut(seed: int):
    """Of bodies joined at random; the inside is told by the winding number, not by the shapes."""
    random = np.random.default_rng(seed)
    bodies = [
        trimesh.creation.box(extents=random.uniform(0.02, 0.2, 3)),
        trimesh.creation.cylinder(radius=random.uniform(0.01, 0.05), height=random.uniform(0.05, 0.2), sections=24),
        trimesh.creation.torus(major_radius=0.08, minor_radius=random.uniform(0.01, 0.03)),
    ]
    parts = [as_mesh(body, turned(body.vertices, random)) for body in bodies]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.vstack([part.faces + start for part, start in zip(parts, starts, strict=False)])
    mesh = TriangleMesh(np.vstack([part.vertices for part in parts]), faces)
    most = int(random.integers(1, 12))
    shapes = shapes_around(MeshSurface(mesh), 0.002, most)
    assert 1 <= len(shapes) <= most
    assert depth(shapes, mesh.vertices).min() >= 0.0
    around = random.uniform(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), (400, 3))
    inner = np.array([point for point in around if any(is_inside(part, point) for part in parts)])
    assert not len(inner) or depth(shapes, inner).min() >= 0.0
    assert shapes_around(MeshSurface(mesh), 0.002, most) == shapes


def test_an_angle_of_one_piece_is_cut_into_its_legs():
    """By planes: the two legs of the outline have no triangles of their own."""
    outline = np.array([(0, 0), (0.2, 0), (0.2, 0.03), (0.03, 0.03), (0.03, 0.2), (0, 0.2)])
    made = trimesh.creation.extrude_polygon(trimesh.path.polygons.Polygon(outline), 0.04)
    surface = MeshSurface(as_mesh(made))
    one, two = shapes_around(surface, 0.005, 1), shapes_around(surface, 0.005, 40)
    assert one[0].volume == pytest.approx(made.convex_hull.volume, rel=0.01)
    assert len(two) == 2
    assert sum(each.volume for each in two) < 1.05 * made.volume
    assert {each.kind for each in two} == {FittedKind.BOX}


def test_the_bound_of_a_large_link_is_a_share_of_its_length_unless_another_is_asked_for(copied: Path):
    small, large = (as_mesh(trimesh.creation.box((side, 0.1, 0.1))) for side in (0.4, 1.2))
    assert usual_bound(small) == pytest.approx(0.005)
    assert usual_bound(large) == pytest.approx(0.012)
    _replace_mesh(copied, trimesh.creation.box((1.2, 0.1, 0.1)))
    arm = load_arm(copied)
    name = _first_with_mesh(arm)
    assert fit_links(arm, only=[name])[0].within == pytest.approx(0.012)
    assert fit_links(arm, 0.003, only=[name])[0].within == 0.003


def test_most_cuts_are_told_apart_by_a_rough_look(monkeypatch: pytest.MonkeyPatch):
    looks: list[int] = []
    whole = cuts.outside

    def counted(part: MeshPart, places: np.ndarray, planes: np.ndarray, rough: int = 1) -> cuts.Outside:
        looks.append(rough)
        return whole(part, places, planes, rough)

    monkeypatch.setattr(cuts, "outside", counted)
    made = trimesh.util.concatenate([trimesh.creation.box((0.2, 0.03, 0.03)), trimesh.creation.box((0.03, 0.2, 0.03))])
    shapes_around(MeshSurface(as_mesh(made)), 0.005, 2)
    assert looks.count(1) <= 2 * (cuts.FINALISTS + cuts.CUTS) + 1  # both sides of each, and what is cut
    assert looks.count(cuts.ROUGH) > looks.count(1)


def test_a_fitted_arm_loads_and_its_neighbours_do_not_touch_once_its_matrix_is_made(copied: Path):
    before = load_arm(copied)
    text, fits = before.urdf_path.read_text(), fit_links(before)
    for fit in fits:
        assert depth(fit.shapes, fit.mesh.vertices).min() >= 0.0
        assert 1 <= len(fit.shapes) <= 40
        assert fit.is_within
        assert fit.excess.share >= SHARE
        assert 0.0 < fit.excess.p95 <= 0.005
        assert fit.excess.p95 < fit.excess.worst < 0.02

    arm = write_fits(before, fits)
    _require_only_collisions_changed(text, arm)
    srdf = arm.srdf_path.read_text()
    arm.srdf_path.write_text(with_pairs(srdf, plan_of(srdf, collision_matrix(arm))[0]))
    kinematics = Kinematics(load_arm(copied))
    assert kinematics.collisions.geometry_count == sum(len(link.collisions) for link in arm.model.links)
    neighbours = {frozenset((joint.parent, joint.child)) for joint in arm.model.joints}
    assert kinematics.collisions.pairs
    assert not neighbours & {frozenset(pair) for pair in kinematics.collisions.pairs}
    for name, configuration in kinematics.arm.named_states.items():
        assert kinematics.collisions.distance(configuration) > CLEARANCE, name
    assert touching_states(kinematics.arm) == []


def _require_only_collisions_changed(text: str, arm: ArmDescription) -> None:
    after = arm.urdf_path.read_text()
    assert after != text
    bare = {link.name: () for link in arm.model.links if link.visuals}
    assert with_collisions(after, bare) == with_collisions(text, bare)
    assert after.count("<!--") == text.count("<!--")


def test_an_arm_that_has_meshes_alone_is_told_what_makes_shapes_and_gets_them(copied: Path):
    arm = load_arm(copied)
    before = arm.urdf_path.read_text()
    arm.urdf_path.write_text(with_collisions(before, {link.name: () for link in arm.model.links if link.visuals}))
    bare = load_arm(copied)
    with pytest.raises(DescriptionError, match=r"gemelo collision fit .* --meshes --write"):
        Kinematics(bare)
    fits = fit_links(bare, most=1)
    write_fits(bare, fits)
    elements = sum(len(shape.shapes) for fit in fits for shape in fit.shapes)
    assert Kinematics(load_arm(copied)).collisions.geometry_count == elements


def test_a_named_state_in_which_the_shapes_touch_is_said(copied: Path):
    arm = load_arm(copied)
    text = arm.srdf_path.read_text()
    arm.srdf_path.write_text(with_pairs(text, plan_of(text, collision_matrix(arm))[0]))
    first, last = arm.model.links[0].name, [link.name for link in arm.model.links if link.collisions][-1]
    block = '<collision><geometry><box size="3 3 3"/></geometry></collision>'
    arm.urdf_path.write_text(with_collisions(arm.urdf_path.read_text(), {first: [block]}))
    said = touching_states(load_arm(copied))
    assert f'in the state "home" {first} and {last} touch' in map(str, said)


def test_a_capsule_is_written_as_what_a_urdf_knows(copied: Path):
    _replace_mesh(copied, trimesh.creation.capsule(radius=0.02, height=0.1))
    arm = load_arm(copied)
    link = _first_with_mesh(arm)
    (fit,) = fit_links(arm, only=[link])
    assert [each.kind for each in fit.shapes] == [FittedKind.CAPSULE]
    write_fits(arm, [fit])
    (written,) = [each for each in load_arm(copied).model.links if each.name == link]
    assert [each.shape for each in written.collisions] == ["cylinder", "sphere", "sphere"]


def test_scale_and_origin_of_the_visual_count(copied: Path):
    made = trimesh.creation.box(extents=(100.0, 50.0, 20.0))
    _replace_mesh(copied, made)
    urdf = load_arm(copied).urdf_path
    name = _mesh_name(copied)
    urdf.write_text(
        urdf.read_text().replace(
            f'<geometry><mesh filename="{name}"/></geometry>',
            f'<origin xyz="0 0 0.5" rpy="0 0 1.5707963"/><geometry><mesh filename="{name}" scale="1e-3 1e-3 1e-3"/>'
            "</geometry>",
            1,
        )
    )
    arm = load_arm(copied)
    (fit,) = fit_links(arm, only=[_first_with_mesh(arm)])
    assert fit.mesh.vertices.max(axis=0) == pytest.approx([0.025, 0.05, 0.51])


def _first_with_mesh(arm: ArmDescription) -> str:
    return next(link.name for link in arm.model.links if link.visuals)


def _mesh_name(folder: Path) -> str:
    (visual,) = next(link for link in load_arm(folder).model.links if link.visuals).visuals
    assert visual.mesh is not None
    return visual.mesh


def _replace_mesh(folder: Path, made: trimesh.Trimesh) -> None:
    made.export(folder / _mesh_name(folder), file_type="glb")


BOX = trimesh.creation.box(extents=(0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        (trimesh.creation.box(extents=(100.0, 80.0, 60.0)), 'is 100 m long: if it is in mm, write scale="0.001'),
        (trimesh.creation.box(extents=(1e-4, 1e-4, 1e-4)), "is 0.1 mm long: see its scale"),
        (trimesh.Trimesh(np.eye(3) * 0.1, [[0, 1, 2]]), "is flat (0 mm thick)"),
        (trimesh.creation.box(extents=(0.1, 0.1, 1e-6)), "is flat (0.001 mm thick)"),
        (trimesh.Trimesh(np.array(BOX.vertices) * [[np.nan]] * 8, BOX.faces, process=False), "is not finite"),
        (b"", "cannot be read"),
        (b"glTF but not really", "cannot be read"),
        (None, "is not there"),
    ],
)
def test_a_mesh_that_bounds_no_link_is_refused_with_its_file(
    copied: Path, broken: trimesh.Trimesh | bytes | None, words: str
):
    path = copied / _mesh_name(copied)
    if isinstance(broken, trimesh.Trimesh):
        _replace_mesh(copied, broken)
    elif broken is None:
        path.unlink()
    else:
        path.write_bytes(broken)
    with pytest.raises(DescriptionError) as refused:
        fit_links(load_arm(copied))
    assert words in str(refused.value)
    assert str(path) in str(refused.value)


def test_a_link_without_a_mesh_and_one_that_is_not_there_are_said(copied: Path):
    arm = load_arm(copied)
    with pytest.raises(DescriptionError, match="there is no link") as absent:
        fit_links(arm, only=["nowhere"])
    assert absent.value.reason.code == "fit.no_link"
    assert absent.value.reason.values == {"file": str(arm.urdf_path), "link": "nowhere"}
    text = arm.urdf_path.read_text()
    arm.urdf_path.write_text(text.replace("<visual>", "<!--").replace("</visual>", "-->"))
    with pytest.raises(DescriptionError, match="its links have no visual mesh") as bare:
        fit_links(load_arm(copied))
    assert bare.value.reason == because("fit.no_visual", file=str(arm.urdf_path))
    with pytest.raises(DescriptionError, match=f'link "{arm.base_frame}" has no visual mesh'):
        fit_links(load_arm(copied), only=[arm.base_frame])


def test_a_file_that_would_not_load_again_stays_as_it_was(copied: Path):
    arm = load_arm(copied)
    fits = fit_links(arm, most=1)
    before = arm.urdf_path.read_bytes()
    outside = TriangleMesh(fits[0].mesh.vertices + 1.0, fits[0].mesh.faces)
    wrong = replace(fits[0], mesh=outside)
    with pytest.raises(DescriptionError, match=r"sticks .* mm out of its shapes"):
        write_fits(arm, [wrong])
    assert arm.urdf_path.read_bytes() == before


def test_a_visual_mesh_is_all_of_them_in_the_links_frame(copied: Path):
    arm = load_arm(copied)
    for link in arm.model.links:
        mesh = visual_mesh(link, copied)
        assert (mesh is None) == (not link.visuals)
        if mesh is not None:
            low, high = trimesh.load(copied / link.visuals[0].mesh).bounds
            assert mesh.vertices.min(axis=0) == pytest.approx(low)
            assert mesh.vertices.max(axis=0) == pytest.approx(high)


def test_edges_of_the_text_stay_as_they_are():
    text = (
        '<robot><!-- <link name="a"><visual/></link> -->\r\n'
        "\t<link name='a'>\r\n\t\t<visual>x</visual>\r\n\t\t<!-- <collision/> -->\r\n\t\t<collision/>\r\n\t</link>\r\n"
        '<link name="b"/><link name="c"><visual/><collision name="old"><geometry/></collision></link></robot>'
    )
    changed = with_collisions(text, {"a": ["<collision>\n  1\n</collision>"], "c": ["<new/>"]})
    assert changed == (
        '<robot><!-- <link name="a"><visual/></link> -->\r\n'
        "\t<link name='a'>\r\n\t\t<visual>x</visual>\r\n\t\t<collision>\r\n\t\t  1\r\n\t\t</collision>\r\n"
        "\t\t<!-- <collision/> -->\r\n\t</link>\r\n"
        '<link name="b"/><link name="c"><visual/>\r\n<new/></link></robot>'
    )
    for link in ("b", "nowhere"):
        with pytest.raises(ValueError, match=f'link "{link}" has no <visual>'):
            with_collisions(text, {link: []})


def _tubes(copied: Path) -> ArmDescription:
    """The arm with a mesh that takes convex hulls."""
    bend = trimesh.creation.cylinder(0.03, 0.2, sections=32)
    cut = bend.slice_plane((0.0, 0.0, 0.0), (0.0, 0.6, 0.8), cap=True)
    _replace_mesh(copied, cut)
    return load_arm(copied)


def test_a_convex_hull_is_written_as_a_file_beside_the_urdf_and_read_as_a_solid(copied: Path):
    arm = _tubes(copied)
    link = _first_with_mesh(arm)
    (fit,) = fit_links(arm, only=[link])
    assert FittedKind.HULL in [each.kind for each in fit.shapes]
    changed = write_fits(arm, [fit])
    shapes = link_shapes(changed)[link]
    assert ShapeKind.HULL in [shape.kind for shape in shapes]
    assert depth_in(shapes, fit.mesh.vertices).min() >= 0.0
    files = sorted((copied / HULLS).iterdir())
    (written,) = [each for each in changed.model.links if each.name == link]
    assert sorted(copied / each.mesh for each in written.collisions if each.mesh) == files


def test_a_hull_that_is_no_longer_needed_leaves_no_file_and_one_that_failed_is_back(copied: Path):
    arm = _tubes(copied)
    (fit,) = fit_links(arm, only=[_first_with_mesh(arm)])
    write_fits(arm, [fit])
    before = {path: path.read_bytes() for path in (copied / HULLS).iterdir()}
    wrong = replace(fit, mesh=TriangleMesh(fit.mesh.vertices + 1.0, fit.mesh.faces), shapes=fit.shapes[:1])
    with pytest.raises(DescriptionError, match=r"sticks .* mm out of its shapes"):
        write_fits(load_arm(copied), [wrong])
    assert {path: path.read_bytes() for path in (copied / HULLS).iterdir()} == before
    _replace_mesh(copied, trimesh.creation.box((0.1, 0.1, 0.1)))
    arm = load_arm(copied)
    write_fits(arm, fit_links(arm, only=[fit.link]))
    assert not (copied / HULLS).exists()
