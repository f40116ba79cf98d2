"""Taking in a scene: what belongs to the arm is computed once, what stood there before is not computed again."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest

from gemelo.libraries.arm.kinematics import self_collisions
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.self_collisions import driver_of, shape_reach
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import AllowedPair, MeshShape, PlanningScene, SceneObject
from gemelo.services.planner.collision import arm_geometry
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.scene_shapes import SceneError
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.collision_geometry.coal_shapes import geometry_of
from gemelo.services.planner.collision_geometry.shapes import SIZES, CollisionShape, ShapeKind
from gemelo.tools.bench.planner.scene_intake import drawn_scene
from tests.planner.test_world import configurations, stl_box

SEVEN = Path(__file__).parent / "arms" / "seven"
OBJECTS = 40


def with_load(scene: PlanningScene, link: str) -> PlanningScene:
    """The first object attached to a link, the second one allowed to touch everything."""
    first, second, *others = scene.objects
    held = msgspec.structs.replace(first, attached=True, frame=link, pose=Transform(translation=(0.0, 0.0, 0.1)))
    allowed = (AllowedPair(first=second.name, second="*"),)
    return PlanningScene(version=scene.version, objects=(held, second, *others), allowed=allowed)


@pytest.fixture(scope="module", params=["rm1", "parol6", "seven"])
def arm(request: pytest.FixtureRequest, rm1_folder: Path) -> ArmDescription:
    return load_arm(SEVEN if request.param == "seven" else rm1_folder.parent / request.param)


class Counted:
    """How often something is called."""

    def __init__(self, function: object) -> None:
        self._function, self.calls = function, 0

    def __call__(self, *arguments: object, **more: object) -> object:
        self.calls += 1
        return self._function(*arguments, **more)  # type: ignore[operator]


@pytest.mark.parametrize("kind", [ShapeKind.BOX, ShapeKind.CYLINDER, ShapeKind.SPHERE, ShapeKind.CAPSULE])
def test_the_box_around_a_plain_solid_is_that_of_coal(kind: ShapeKind):
    for size in np.random.default_rng(3).uniform(0.01, 2.0, (20, SIZES[kind])):
        shape = CollisionShape("it", kind, tuple(size.tolist()))
        ours, theirs = geometry_of(shape), geometry_of(shape)
        assert arm_geometry.box_around(shape, ours) == pytest.approx(arm_geometry.box_of(theirs), abs=1e-12)
        assert ours.aabb_radius == theirs.aabb_radius > 0.0


def test_a_scene_costs_no_walk_along_the_chain_for_what_stands_still(
    arm: ArmDescription, monkeypatch: pytest.MonkeyPatch
):
    reach, load = Counted(arm_geometry.shape_reach), Counted(arm_geometry.load_collision_geometry)
    monkeypatch.setattr(arm_geometry, "shape_reach", reach)
    monkeypatch.setattr(self_collisions, "shape_reach", reach)
    monkeypatch.setattr(arm_geometry, "load_collision_geometry", load)
    kinematics = Kinematics(arm)
    reach.calls = 0
    _ = World(arm, kinematics).geometry
    for_the_arm = reach.calls
    assert for_the_arm > 0
    for seed in range(3):
        _ = World(arm, kinematics, drawn_scene(seed, OBJECTS)).geometry
    assert (reach.calls, load.calls) == (for_the_arm, 1)


def test_one_object_more_is_one_object_computed(arm: ArmDescription, monkeypatch: pytest.MonkeyPatch):
    scene = drawn_scene(1, OBJECTS + 1)
    fewer = PlanningScene(version=1, objects=scene.objects[:OBJECTS])
    kinematics = Kinematics(arm)
    _ = World(arm, kinematics, fewer).geometry
    made, read = Counted(arm_geometry.geometry_of), Counted(arm_geometry.shape_of)
    monkeypatch.setattr(arm_geometry, "geometry_of", made)
    monkeypatch.setattr(arm_geometry, "shape_of", read)
    world = World(arm, kinematics, scene)
    assert (read.calls, made.calls) == (1, 0)
    _ = world.geometry
    assert made.calls == 1


def test_what_coal_needs_is_made_when_it_is_first_asked_and_of_meshes_at_once(
    arm: ArmDescription, monkeypatch: pytest.MonkeyPatch
):
    kinematics = Kinematics(arm)
    made = Counted(arm_geometry.geometry_of)
    monkeypatch.setattr(arm_geometry, "geometry_of", made)
    world = World(arm, kinematics, drawn_scene(1, OBJECTS))
    assert made.calls == 0
    assert world.distance(configurations(arm, 1)[0]) < np.inf
    assert made.calls == OBJECTS
    block = SceneObject(name="block", shape=MeshShape(data=stl_box(0.1)), pose=Transform(translation=(3.0, 0.0, 0.0)))
    World(arm, kinematics, PlanningScene(version=2, objects=(block,)))
    assert made.calls == OBJECTS + 1


def test_a_scene_that_cannot_be_is_refused_at_once(arm: ArmDescription):
    kinematics, scene = Kinematics(arm), drawn_scene(1, 3)
    first, second, third = scene.objects
    for objects, code in (
        ((first, second, msgspec.structs.replace(third, name=first.name)), "scene.names.same"),
        ((first, msgspec.structs.replace(second, attached=True, frame="nowhere"), third), "scene.link.gone"),
        ((first, second, msgspec.structs.replace(third, padding=-1.0)), "scene.object.padding"),
    ):
        for _ in range(2):  # what was refused is not known the second time either
            with pytest.raises(SceneError) as refused:
                World(arm, kinematics, PlanningScene(version=1, objects=objects))
            assert refused.value.reason.code == code


def test_a_scene_is_that_of_its_objects_whatever_stood_there_before(arm: ArmDescription):
    """Objects come, go, move and change places: the native planner's answers are those of one that saw nothing
    before."""
    kinematics, random = Kinematics(arm), np.random.default_rng(7)
    checker = CollisionChecker(World(arm, kinematics))
    pool = drawn_scene(5, 24).objects
    rows = configurations(arm, 60)
    for _ in range(12):
        chosen = [pool[number] for number in random.permutation(len(pool))[: int(random.integers(1, 12))]]
        moved = pool[int(random.integers(len(pool)))].pose
        objects = (msgspec.structs.replace(chosen[0], pose=moved), *chosen[1:])
        scene = PlanningScene(version=1, objects=objects)
        if random.uniform() < 0.5 and len(objects) > 1:
            scene = with_load(scene, arm.tool_frame)
        checker.newest = World(arm, kinematics, scene)
        checker.begin()
        fresh = CollisionChecker(World(arm, Kinematics(arm), scene))
        ours, theirs = checker.native(CLEARANCE), fresh.native(CLEARANCE)
        assert ours.free(rows).tolist() == theirs.free(rows).tolist()
        assert [ours.nearest(row) for row in rows] == [theirs.nearest(row) for row in rows]
        assert [ours.touching(np.array((row, row))) is None for row in rows] == [
            theirs.touching(np.array((row, row))) is None for row in rows
        ]
        assert checker.world.pairs == fresh.world.pairs


def test_the_reach_of_pairs_is_what_the_chain_between_them_gives(arm: ArmDescription):
    kinematics = Kinematics(arm)
    world = World(arm, kinematics, with_load(drawn_scene(2, 12), arm.tool_frame))
    geometry, model = world.geometry, kinematics.model
    shapes = geometry.model.geometryObjects
    carriers = [{joint for joint in model.supports[shape.parentJoint] if joint > 0} for shape in shapes]
    expected = np.zeros((len(geometry.pairs), len(arm.joints)))
    for row, (one, other) in enumerate(geometry.pairs):
        for joint in carriers[one] ^ carriers[other]:
            moved = shapes[one if joint in carriers[one] else other]
            source, scale = driver_of(arm, model, joint)
            expected[row, source] += scale * shape_reach(arm, model, moved, joint)
    assert world.pair_reach == pytest.approx(expected, abs=1e-12)
    assert world.reach == pytest.approx(self_collisions.reach_of(arm, model, geometry.model), abs=1e-12)


def test_distances_are_pinocchios_however_the_world_was_come_by(arm: ArmDescription):
    """Of every pair of shapes, after objects have come, moved and gone."""
    kinematics = Kinematics(arm)
    for seed in range(3):
        World(arm, kinematics, drawn_scene(seed, OBJECTS))
    scene = with_load(drawn_scene(2, OBJECTS), arm.tool_frame)
    world = World(arm, kinematics, scene)
    assert world.pairs == World(arm, Kinematics(arm), scene).pairs
    geometry = world.geometry.model.copy()
    geometry.removeAllCollisionPairs()
    for one, other in world.geometry.pairs:
        geometry.addCollisionPair(pin.CollisionPair(one, other))
    data, placed = kinematics.model.createData(), geometry.createData()
    numbers = range(len(world.pair_names))
    for configuration in configurations(arm, 10):
        q = kinematics.configuration.to_pinocchio(configuration)
        pin.computeDistances(kinematics.model, data, geometry, placed, q)
        expected = [result.min_distance for result in placed.distanceResults]
        assert world.distances(configuration, list(numbers)) == pytest.approx(expected, abs=5e-6)
        assert world.distance(configuration) == pytest.approx(min(expected), abs=5e-6)


def test_what_is_allowed_to_touch_is_not_checked_and_nothing_else_is_left_out(arm: ArmDescription):
    scene = with_load(drawn_scene(2, 12), arm.tool_frame)
    world = World(arm, Kinematics(arm), scene)
    links = [link.name for link in arm.model.links if link.collisions]
    held, free, *others = (item.name for item in scene.objects)
    pairs = {frozenset(pair) for pair in world.pairs}
    assert not any(free in pair for pair in pairs)
    assert frozenset((held, arm.tool_frame)) not in pairs
    assert {frozenset((held, other)) for other in others} <= pairs
    moving = [link for link in links if frozenset((link, others[0])) in pairs]
    assert moving
    assert {frozenset((link, other)) for link in moving for other in others} <= pairs


def test_a_mesh_file_that_has_changed_is_read_again(arm: ArmDescription, tmp_path: Path):
    item = SceneObject(name="block", shape=MeshShape(path="block.stl"), pose=Transform(translation=(3.0, 0.0, 0.0)))
    scene, kinematics = PlanningScene(version=1, objects=(item,)), Kinematics(arm)
    (tmp_path / "block.stl").write_bytes(stl_box(0.1))
    small = World(arm, kinematics, scene, (tmp_path,))
    (tmp_path / "block.stl").write_bytes(stl_box(0.5))
    large = World(arm, kinematics, scene, (tmp_path,))
    there = configurations(arm, 1)[0]
    numbers = [number for number, pair in enumerate(large.pair_names) if "block" in pair]
    assert (small.distances(there, numbers) > large.distances(there, numbers) + 0.3).all()
