"""The reference checker: the arm, what it carries and what stands around it."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import Value
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    Shape,
    SphereShape,
)
from gemelo.services.planner.collision.scene_shapes import SceneError
from gemelo.services.planner.collision.world import World

LINK_PAIR_MARGIN = 0.05  # [m]
ROUNDING = 2e-6  # [m] coal's GJK stops at 1e-6, from where it stopped last


def configurations(arm: ArmDescription, count: int) -> np.ndarray:
    random = np.random.default_rng(4)
    lower = [max(joint.lower, -3.0) for joint in arm.joints]
    upper = [min(joint.upper, 3.0) for joint in arm.joints]
    return random.uniform(lower, upper, size=(count, len(arm.joints)))


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def kinematics(request: pytest.FixtureRequest, rm1_folder: Path) -> Kinematics:
    return Kinematics(load_arm(rm1_folder.parent / request.param))


@pytest.fixture(scope="module")
def moving_link(kinematics: Kinematics) -> str:
    """A link with a collision shape that the joints move."""
    return kinematics.collisions.pairs[-1][1]


def scene_of(*shapes: Shape, at: tuple[float, ...] = (0.6, 0.0, 0.3), padding: float = 0.0) -> PlanningScene:
    return PlanningScene(
        objects=tuple(
            SceneObject(name=f"thing {index}", shape=shape, pose=Transform(translation=at), padding=padding)
            for index, shape in enumerate(shapes)
        )
    )


def stl_box(half: float) -> bytes:
    """A binary STL cube of 12 triangles."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *corners[face].ravel(), 0) for face in faces)
    return bytes(80) + struct.pack("<I", len(faces)) + rows


def test_a_world_without_a_scene_says_what_self_collisions_say(kinematics: Kinematics) -> None:
    world = World(kinematics.arm, kinematics)
    own = kinematics.collisions
    assert world.pairs == own.pairs
    assert world.geometry_count == own.geometry_count
    assert world.reach.tolist() == own.reach.tolist()
    for configuration in configurations(kinematics.arm, 200):
        assert world.distance(configuration) == pytest.approx(own.distance(configuration), abs=ROUNDING)
        within = own.pairs_within(configuration, LINK_PAIR_MARGIN)
        assert world.pairs_within(configuration, LINK_PAIR_MARGIN) == within


def test_distances_between_carried_and_standing_solids_are_those_of_geometry(
    kinematics: Kinematics, moving_link: str
) -> None:
    """A carried sphere's distance to each kind of solid, in the solid's own frame, by its formula."""
    turn = (0.0, 0.0, np.sin(0.3), np.cos(0.3))
    at, ball = (0.1, 0.2, 1.5), 0.02
    mesh = MeshShape(data=stl_box(100.0), scale=(0.001, 0.001, 0.001))
    solids: dict[str, Shape] = {
        "box": BoxShape(size=(0.2, 0.3, 0.4)),
        "sphere": SphereShape(radius=0.1),
        "cylinder": CylinderShape(radius=0.1, length=0.3),
        "plane": PlaneShape(),
        "mesh": mesh,
    }

    def expected(kind: str, point: np.ndarray) -> float:
        radial = float(np.hypot(point[0], point[1]))
        match kind:
            case "box":
                return float(np.linalg.norm(np.maximum(np.abs(point) - (0.1, 0.15, 0.2), 0.0)))
            case "sphere":
                return float(np.linalg.norm(point)) - 0.1
            case "cylinder":
                return float(np.hypot(max(radial - 0.1, 0.0), max(abs(point[2]) - 0.15, 0.0)))
            case "plane":
                return float(point[2])
        return float(np.linalg.norm(np.maximum(np.abs(point) - 0.1, 0.0)))

    carried = SceneObject(name="ball", shape=SphereShape(radius=ball), frame=moving_link, attached=True)
    for kind, solid in solids.items():
        standing = SceneObject(name=kind, shape=solid, pose=Transform(translation=at, rotation=turn))
        links = tuple(AllowedPair(first=link, second="*") for link in kinematics.arm.model.link_names)
        checked = PlanningScene(objects=(carried, standing), allowed=links)
        world = World(kinematics.arm, kinematics, checked)
        assert world.pairs == (("ball", kind),)
        for configuration in configurations(kinematics.arm, 30):
            centre = np.array(kinematics.link_poses(configuration)[moving_link].translation) - at
            c, s = np.cos(0.6), np.sin(0.6)
            local = np.array([c * centre[0] + s * centre[1], -s * centre[0] + c * centre[1], centre[2]])
            assert world.distance(configuration) == pytest.approx(expected(kind, local) - ball, abs=1e-6), kind


def test_few_exact_looks_find_what_all_of_them_find(kinematics: Kinematics) -> None:
    random = np.random.default_rng(1)
    boxes = [
        SceneObject(
            name=f"box {index}",
            shape=BoxShape(size=tuple(random.uniform(0.02, 0.2, 3).tolist())),
            pose=Transform(translation=tuple(random.uniform(-0.6, 0.6, 3).tolist())),
        )
        for index in range(40)
    ]
    world = World(kinematics.arm, kinematics, PlanningScene(objects=tuple(boxes)))
    for configuration in configurations(kinematics.arm, 30):
        every = world.contacts(configuration, 10.0)
        assert len(every) == len(world.pairs)
        assert every[0].distance == pytest.approx(world.distance(configuration), abs=ROUNDING)
        near = world.pairs_within(configuration, every[3].distance + ROUNDING)
        assert {(contact.first, contact.second) for contact in every[:4]} <= set(near)


def test_padding_is_kept_around_an_object(kinematics: Kinematics) -> None:
    bare = World(kinematics.arm, kinematics, scene_of(SphereShape(radius=0.25)))
    padded = World(kinematics.arm, kinematics, scene_of(SphereShape(radius=0.25), padding=0.03))
    larger = World(kinematics.arm, kinematics, scene_of(SphereShape(radius=0.28)))
    for configuration in configurations(kinematics.arm, 20):
        assert padded.distance(configuration) == pytest.approx(larger.distance(configuration), abs=ROUNDING)
        assert padded.distance(configuration) <= bare.distance(configuration) + ROUNDING


def test_a_carried_object_moves_with_its_link_and_makes_the_reach_longer(kinematics: Kinematics) -> None:
    tool = kinematics.arm.tool_frame
    crate = SceneObject(
        name="crate",
        shape=BoxShape(size=(1.0, 1.0, 1.0)),
        frame=tool,
        attached=True,
    )
    wall = SceneObject(name="wall", shape=BoxShape(size=(0.02, 2.0, 2.0)), pose=Transform(translation=(0.9, 0.0, 0.0)))
    world = World(kinematics.arm, kinematics, PlanningScene(objects=(crate, wall)))
    own = kinematics.collisions
    assert ("crate", "wall") in world.pairs
    assert (world.reach >= own.reach).all()
    assert world.reach[0] > own.reach[0]
    meets = [
        ("crate", "wall") in world.pairs_within(configuration) for configuration in configurations(kinematics.arm, 100)
    ]
    assert any(meets)
    assert not all(meets)


def test_no_point_moves_farther_than_the_reach_says(kinematics: Kinematics) -> None:
    """The ground of conservative advancement: a small turn changes no distance by more than reach times turn."""
    stick = SceneObject(
        name="stick", shape=BoxShape(size=(0.01, 0.01, 0.6)), frame=kinematics.arm.tool_frame, attached=True
    )
    pole = SceneObject(
        name="pole", shape=CylinderShape(radius=0.02, length=2.0), pose=Transform(translation=(0.5, 0.0, 0.0))
    )
    world = World(kinematics.arm, kinematics, PlanningScene(objects=(stick, pole)))
    for configuration in configurations(kinematics.arm, 30):
        for joint in range(len(configuration)):
            turned = configuration.copy()
            turned[joint] += 0.01
            change = abs(world.distance(turned) - world.distance(configuration))
            assert change <= 2.0 * world.reach[joint] * 0.01 + 1e-6


def test_touch_links_and_allowed_pairs_are_not_checked(kinematics: Kinematics, moving_link: str) -> None:
    block = SceneObject(name="block", shape=BoxShape(size=(3.0, 3.0, 3.0)))
    configuration = configurations(kinematics.arm, 1)[0]
    blocked = World(kinematics.arm, kinematics, PlanningScene(objects=(block,)))
    assert any(moving_link in pair for pair in blocked.pairs_within(configuration))
    free = AllowedPair(first="block", second="*")
    assert World(kinematics.arm, kinematics, PlanningScene(objects=(block,), allowed=(free,))).pairs == (
        kinematics.collisions.pairs
    )
    one = AllowedPair(first=moving_link, second="block")
    world = World(kinematics.arm, kinematics, PlanningScene(objects=(block,), allowed=(one,)))
    assert (moving_link, "block") not in world.pairs
    first = kinematics.collisions.pairs[0][0]
    held = SceneObject(
        name="held", shape=SphereShape(radius=1.0), frame=moving_link, attached=True, touch_links=(first,)
    )
    names = set(World(kinematics.arm, kinematics, PlanningScene(objects=(held,))).pairs)
    assert (moving_link, "held") not in names
    assert (first, "held") not in names
    assert any("held" in pair for pair in names)


def test_what_stands_still_is_not_checked_against_what_stands_still(kinematics: Kinematics) -> None:
    table = SceneObject(name="table", shape=PlaneShape())
    world = World(kinematics.arm, kinematics, PlanningScene(objects=(table,)))
    assert (kinematics.arm.base_frame, "table") not in world.pairs
    assert any("table" in pair for pair in world.pairs)


def test_inside_a_closed_mesh_is_inside(kinematics: Kinematics) -> None:
    """coal knows a mesh's surface only; an arm wholly within it would look free."""
    shell = SceneObject(name="shell", shape=MeshShape(data=stl_box(2.0)))
    world = World(kinematics.arm, kinematics, PlanningScene(objects=(shell,)))
    assert world.distance(configurations(kinematics.arm, 1)[0]) < -0.5


def test_contacts_name_both_with_depth_and_place(kinematics: Kinematics, moving_link: str) -> None:
    at = np.array(kinematics.link_poses(np.zeros(len(kinematics.arm.joints)))[moving_link].translation)
    world = World(kinematics.arm, kinematics, scene_of(SphereShape(radius=0.05), at=tuple(at.tolist())))
    touching = [
        contact for contact in world.contacts(np.zeros(len(kinematics.arm.joints))) if contact.second == "thing 0"
    ]
    assert touching[0].distance <= touching[-1].distance <= 0.0
    assert np.linalg.norm(np.array(touching[0].point) - at) < 0.1


def test_a_scene_that_cannot_be_is_refused_by_name(kinematics: Kinematics, tmp_path: Path) -> None:
    (tmp_path / "text.stl").write_bytes(b"this is no mesh")
    bad: list[tuple[Shape, str, dict[str, Value]]] = [
        (BoxShape(size=(1.0, 1.0, -1.0)), "scene.shape.size", {"size": "z", "kind": "box", "value": -1.0}),
        (BoxShape(size=(1.0,)), "scene.shape.count", {"kind": "box", "needed": 3, "count": 1}),
        (SphereShape(), "scene.shape.size", {"size": "radius", "kind": "sphere", "value": 0.0}),
        (CylinderShape(radius=0.1), "scene.shape.size", {"size": "length", "kind": "cylinder", "value": 0.0}),
        (MeshShape(path="none.stl"), "scene.mesh.none", {"path": "none.stl", "folders": (str(tmp_path),)}),
        (MeshShape(path="text.stl"), "scene.mesh.file", {"path": "text.stl"}),
        (MeshShape(data=bytes(84)), "scene.mesh.data", {}),
        (MeshShape(path="../a.stl"), "scene.mesh.elsewhere", {"path": "../a.stl"}),
        (MeshShape(data=stl_box(1.0), scale=(0.0, 1.0, 1.0)), "scene.mesh.scale", {"scale": (0.0, 1.0, 1.0)}),
    ]
    for shape, code, values in bad:
        with pytest.raises(SceneError) as refused:
            World(kinematics.arm, kinematics, scene_of(shape), (tmp_path,))
        assert refused.value.reason.code == code
        assert {"object": "thing 0", **values}.items() <= refused.value.reason.values.items()


def test_an_object_on_a_link_that_is_not_there_is_refused(kinematics: Kinematics) -> None:
    cup = SceneObject(name="cup", shape=SphereShape(radius=0.1), frame="no_such_link", attached=True)
    with pytest.raises(SceneError, match='"cup" is attached to "no_such_link"'):
        World(kinematics.arm, kinematics, PlanningScene(objects=(cup,)))
