"""Edits of the planning scene: what each does, what it refuses, and that nothing leaves it broken."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.frames.transforms import compose, from_message, to_message
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneAdd,
    SceneAllow,
    SceneAttach,
    SceneClear,
    SceneDetach,
    SceneDisallow,
    SceneEdit,
    SceneMove,
    SceneObject,
    SceneRemove,
    SceneReplace,
    SceneRequest,
    SceneResize,
    Shape,
    SphereShape,
)
from gemelo.services.planner.scene.scene_check import require_scene
from gemelo.services.planner.scene.scene_file import DamagedScene, load_scene, put_aside, save_scene
from gemelo.services.planner.scene.scene_store import SceneStore
from tests.profiles import examples

Poses = Mapping[str, Transform]
ARM = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
TOOL = ARM.tool_frame


def poses_at(*values: float) -> Poses:
    positions = dict(zip(ARM.joint_names, values, strict=True))
    return {name: to_message(pose) for name, pose in link_transforms(ARM.model, positions).items()}


HERE, THERE = poses_at(0.3, -0.4, 0.05), poses_at(-0.9, 1.0, 0.1)


class Scene:
    """A store, and the arm where it stands at the moment."""

    def __init__(self, scene: PlanningScene | None = None, folder: Path | None = None) -> None:
        self.store = SceneStore(ARM, (folder,) if folder else (), scene)
        self.links: Poses | None = HERE
        self.now = 0

    def edit(self, edit: SceneEdit) -> str:
        """The reason of a refusal; empty where it was accepted."""
        self.now += 1
        before = self.store.scene
        response = self.store.edit(SceneRequest(edit=edit), lambda: self.links, self.now)
        assert response.accepted == (response.reason == "")
        assert response.version == self.store.scene.version
        assert response.accepted or self.store.scene is before
        return response.reason

    def add(self, name: str, shape: Shape | None = None, **fields: object) -> str:
        item = SceneObject(name=name, shape=shape or SphereShape(radius=0.1))
        return self.edit(SceneAdd(object=msgspec.structs.replace(item, **fields)))

    def object(self, name: str) -> SceneObject:
        return next(item for item in self.store.scene.objects if item.name == name)


def at(x: float, y: float, z: float) -> Transform:
    return Transform(translation=(x, y, z), rotation=(0.0, 0.0, math.sin(0.2), math.cos(0.2)))


def assert_same_place(one: Transform, other: Transform) -> None:
    assert one.translation == pytest.approx(other.translation, abs=1e-12)
    assert one.rotation == pytest.approx(other.rotation, abs=1e-12)


def in_base(item: SceneObject, links: Poses) -> Transform:
    frame = from_message(links[item.frame]) if item.frame else from_message(Transform())
    return to_message(compose(frame, from_message(item.pose)))


def test_every_change_is_one_version_and_an_object_of_the_same_name_is_replaced() -> None:
    scene = Scene()
    assert scene.add("box") == ""
    assert scene.add("box", BoxShape(size=(0.1, 0.2, 0.3))) == ""
    assert scene.add("ball") == ""
    assert scene.store.scene.version == 3
    assert scene.store.scene.stamp == 3
    assert [item.name for item in scene.store.scene.objects] == ["box", "ball"]
    assert scene.object("box").shape == BoxShape(size=(0.1, 0.2, 0.3))


def test_an_edit_that_changes_nothing_is_accepted_and_is_no_new_version() -> None:
    scene = Scene()
    scene.add("box")
    scene.edit(SceneAllow(pair=AllowedPair(first="box", second="base_link")))
    assert scene.edit(SceneAllow(pair=AllowedPair(first="base_link", second="box"))) == ""
    assert scene.store.scene.version == 2


def test_what_is_carried_moves_with_the_arm_and_stays_where_it_is_let_go() -> None:
    scene = Scene()
    scene.add("cup", pose=at(0.3, 0.1, 0.2))
    assert scene.edit(SceneAttach(name="cup", link=TOOL, touch_links=("base_link",))) == ""
    assert_same_place(in_base(scene.object("cup"), HERE), at(0.3, 0.1, 0.2))
    assert scene.object("cup").touch_links == ("base_link",)
    scene.links = THERE
    held = in_base(scene.object("cup"), THERE)
    assert scene.edit(SceneDetach(name="cup")) == ""
    assert scene.object("cup").frame == ""
    assert_same_place(scene.object("cup").pose, held)
    assert scene.edit(SceneDetach(name="cup")) == 'object "cup" is not attached to any link; there is nothing to detach'


def test_an_object_placed_by_a_link_stands_still_from_then_on() -> None:
    scene = Scene()
    assert scene.add("mark", pose=at(0.0, 0.0, 0.1), frame=TOOL) == ""
    expected = to_message(compose(from_message(HERE[TOOL]), from_message(at(0.0, 0.0, 0.1))))
    assert scene.object("mark").frame == ""
    assert_same_place(scene.object("mark").pose, expected)


def test_moving_and_resizing_keep_the_rest() -> None:
    scene = Scene()
    scene.add("cup", pose=at(0.3, 0.1, 0.2), padding=0.01)
    assert scene.edit(SceneMove(name="cup", pose=at(0.1, 0.0, 0.0))) == ""
    assert scene.edit(SceneResize(name="cup", shape=CylinderShape(radius=0.1, length=1.0))) == ""
    assert scene.object("cup") == SceneObject(
        name="cup", shape=CylinderShape(radius=0.1, length=1.0), pose=scene.object("cup").pose, padding=0.01
    )
    assert_same_place(scene.object("cup").pose, at(0.1, 0.0, 0.0))


def test_a_carried_object_that_is_moved_stays_carried() -> None:
    scene = Scene()
    scene.add("cup", frame=TOOL, attached=True)
    assert scene.edit(SceneMove(name="cup", pose=at(0.0, 0.0, 0.1), frame=TOOL)) == ""
    assert_same_place(scene.object("cup").pose, at(0.0, 0.0, 0.1))
    assert scene.edit(SceneMove(name="cup", pose=at(0.2, 0.1, 0.1))) == ""
    assert_same_place(in_base(scene.object("cup"), HERE), at(0.2, 0.1, 0.1))
    assert scene.object("cup").attached


def test_what_was_allowed_to_an_object_goes_with_it() -> None:
    scene = Scene()
    scene.add("cup")
    scene.add("table", PlaneShape())
    scene.edit(SceneAllow(pair=AllowedPair(first="cup", second="table")))
    scene.edit(SceneAllow(pair=AllowedPair(first="*", second="table")))
    assert scene.edit(SceneRemove(name="cup")) == ""
    assert scene.store.scene.allowed == (AllowedPair(first="*", second="table"),)
    assert scene.edit(SceneDisallow(pair=AllowedPair(first="table", second="*"))) == ""
    assert scene.edit(SceneClear()) == ""
    assert scene.store.scene.objects == ()


def test_refusals_name_the_thing_the_value_and_the_remedy() -> None:
    scene = Scene()
    scene.add("table", PlaneShape())
    scene.add("cup", frame=TOOL, attached=True)
    sphere = SphereShape(radius=0.1)
    scene.links = None
    assert scene.edit(SceneRemove(name="tabel")) == 'there is no object "tabel"; did you mean "table"?'
    assert scene.add("base_link") == '"base_link" is a link of rm1; give the object another name'
    assert scene.add("*").startswith('"*" stands for any name')
    assert scene.add("").startswith('"" is no name for an object')
    assert scene.add("a\nb").startswith('"a\nb" is no name for an object')
    assert scene.add("ball", SphereShape(radius=-0.1)).startswith('object "ball": radius of the sphere is -0.1 m')
    assert scene.add("ball", sphere, padding=-1.0).startswith('object "ball": padding is -1 m')
    assert scene.add("ball", sphere, pose=Transform(rotation=(0.0, 0.0, 0.0, 2.0))).startswith(
        'object "ball": the quat'
    )
    assert scene.add("ball", sphere, pose=at(1e6, 0.0, 0.0)).endswith("is that in mm?")
    assert scene.add("ball", sphere, frame="efektor_link", attached=True) == (
        'object "ball" cannot be attached: rm1 has no link "efektor_link"; did you mean "efector_link"?'
    )
    assert scene.add("ball", sphere, frame=TOOL, attached=True, touch_links=("nose",)).startswith(
        'object "ball" cannot touch it: rm1 has no link "nose"'
    )
    assert scene.add("ball", sphere, frame=TOOL).startswith(
        f'object "ball" cannot be placed by "{TOOL}": it is not known where the arm is'
    )
    assert scene.edit(SceneMove(name="cup", frame="nose")).startswith(
        'object "cup" cannot be placed: rm1 has no link "nose"'
    )
    assert scene.edit(SceneAttach(name="table", link="nose")).startswith(
        'object "table" cannot be attached: rm1 has no link "nose"'
    )
    scene.links = HERE
    assert scene.edit(SceneAttach(name="table", link=TOOL)).startswith('object "table" is a plane')
    assert scene.edit(SceneResize(name="cup", shape=PlaneShape())).startswith('object "cup" is a plane')
    pairs = {
        ("*", "*"): "the pair allows everything to touch everything",
        ("cup", "cup"): 'the pair allows "cup" to touch itself',
        ("cup", "tabel"): 'there is no link or object "tabel"; did you mean "table"?',
    }
    for (first, second), reason in pairs.items():
        assert scene.edit(SceneAllow(pair=AllowedPair(first=first, second=second))).startswith(reason)
    assert scene.edit(SceneDisallow(pair=AllowedPair(first="cup", second="table"))).startswith(
        '"cup" and "table" are not allowed to touch by this scene, which allows nothing'
    )
    twice = PlanningScene(objects=(SceneObject(name="a", shape=sphere), SceneObject(name="a", shape=sphere)))
    assert scene.edit(SceneReplace(scene=twice)).startswith('the scene has two objects "a"')


def test_a_mesh_is_read_when_it_is_added(tmp_path: Path) -> None:
    scene = Scene(folder=tmp_path)
    text = "solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"
    (tmp_path / "plate.stl").write_text(text)
    (tmp_path / "cut.stl").write_text(text[: text.index("vertex 0 1 0")])
    assert scene.add("plate", MeshShape(path="plate.stl")) == ""
    assert scene.add("cut", MeshShape(path="cut.stl")).startswith(
        'object "cut": "cut.stl" is no usable STL file: it has 2'
    )
    for path in ("none.stl", "n\0ne.stl", "n" * 5000):
        assert scene.add("none", MeshShape(path=path)).startswith(f'object "none": there is no mesh "{path}"')
    assert scene.add("empty", MeshShape(data=b"")).startswith('object "empty": its data is no usable STL file')


names = st.sampled_from(["a", "b", "c", "*", "", TOOL, "base_link", "unknown"])
numbers = st.sampled_from([-0.1, 0.0, 0.1, 0.5, 1e9])
shapes = st.one_of(
    st.builds(BoxShape, size=st.lists(numbers, min_size=2, max_size=3).map(tuple)),
    st.builds(SphereShape, radius=numbers),
    st.builds(CylinderShape, radius=numbers, length=numbers),
    st.builds(PlaneShape),
    st.builds(MeshShape, path=names),
)
places = st.builds(
    Transform,
    translation=st.tuples(numbers, numbers, numbers),
    rotation=st.sampled_from([(0.0, 0.0, 0.0, 1.0), (0.6, 0.0, 0.0, 0.8), (0.0, 0.0, 0.0, 0.0), (1.0,)]),
)
objects = st.builds(
    SceneObject,
    name=names,
    shape=shapes,
    pose=places,
    frame=names,
    attached=st.booleans(),
    touch_links=st.lists(names, max_size=2).map(tuple),
    padding=numbers,
)
pairs = st.builds(AllowedPair, first=names, second=names)
scenes = st.builds(
    PlanningScene, objects=st.lists(objects, max_size=3).map(tuple), allowed=st.lists(pairs, max_size=2).map(tuple)
)
shapes = st.builds(lambda item: item.shape, objects)
poses = st.builds(lambda item: item.pose, objects)
links = st.lists(names, max_size=2).map(tuple)
edits_of_a_scene = st.one_of(
    st.builds(SceneAdd, object=objects),
    st.builds(SceneRemove, name=names),
    st.builds(SceneMove, name=names, pose=poses, frame=names),
    st.builds(SceneResize, name=names, shape=shapes),
    st.builds(SceneAttach, name=names, link=names, touch_links=links),
    st.builds(SceneDetach, name=names),
    st.builds(SceneAllow, pair=pairs),
    st.builds(SceneDisallow, pair=pairs),
    st.builds(SceneReplace, scene=scenes),
    st.builds(SceneClear),
)
requests = st.builds(SceneRequest, edit=edits_of_a_scene)


@examples(quick=30, full=150)
@given(st.lists(st.tuples(requests, st.sampled_from([HERE, THERE, None])), max_size=12))
def test_no_sequence_of_edits_leaves_a_scene_that_cannot_be(edits: list[tuple[SceneRequest, Poses | None]]) -> None:
    store = SceneStore(ARM)
    for stamp, (request, links) in enumerate(edits):
        before = store.scene
        response = store.edit(request, lambda links=links: links, stamp)  # type: ignore[misc]
        require_scene(ARM, store.scene, ())
        assert store.scene.version - before.version == (store.scene != before)
        assert response.accepted or response.reason
        assert all(item.frame == "" or item.attached for item in store.scene.objects)


@examples(quick=15, full=50)
@given(scene=scenes)
def test_a_saved_scene_is_the_same_when_it_is_loaded(
    scene: PlanningScene, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "some" / "scene.json"
    save_scene(path, scene)
    assert load_scene(path) == scene
    assert [file.name for file in path.parent.iterdir()] == ["scene.json"]


def test_meshes_travel_in_the_file(tmp_path: Path) -> None:
    scene = PlanningScene(objects=(SceneObject(name="m", shape=MeshShape(data=bytes(range(256)))),))
    save_scene(tmp_path / "scene.json", scene)
    assert load_scene(tmp_path / "scene.json") == scene


@pytest.mark.parametrize(
    "content", [b"", b"{", b'{"objects": 3}', b'{"objects": [{"shape": {"type": "cone"}}]}', b"\xff"]
)
def test_a_damaged_file_is_told_and_put_aside(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    assert load_scene(path) is None
    path.write_bytes(content)
    with pytest.raises(DamagedScene, match="holds no scene"):
        load_scene(path)
    assert put_aside(path).read_bytes() == content
    assert not path.exists()
