"""Meshes of ten megabytes in the scene, and one scene for planner, list, page, viewer and recording."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gemelo
from gemelo.libraries.recordings.subscriptions import Subscriptions
from gemelo.libraries.runtime.bus.wire import MAX_PAYLOAD_OF
from gemelo.libraries.runtime.scene_meshes import SceneMeshes
from gemelo.schemas.message import encode
from gemelo.schemas.scene import BoxShape, MeshShape, PlanningScene, SceneMove, SceneObject, SceneRequest
from gemelo.schemas.scene_meshes import by_digest, mesh_digest, with_meshes
from gemelo.schemas.system import Exchange
from gemelo.schemas.topics import SCENE, SCENE_EDIT, exchange_topic, scene_mesh
from gemelo.services.panel.model.readings import BusReadings
from gemelo.services.planner import main as planner_main
from gemelo.services.planner.scene.scene_keeper import SceneKeeper

KEEPERS: list[SceneKeeper] = []
FAR = (3.0, 0.0, 0.0)  # [m] from where no arm is in its way
SIZES = (600, 20_000, 30_000, 40_000, 45_000)  # [bytes] about the limits that the drawn test sets


class SeenKeeper(SceneKeeper):
    """The planner's own, which the tests may look at."""

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)  # type: ignore[arg-type]
        KEEPERS.append(self)


@dataclass
class Everybody:
    """One arm with all who have its scene."""

    arm: gemelo.api.simulation.SimulatedArm
    keeper: SceneKeeper
    page: BusReadings
    viewed: list[PlanningScene]  # what the viewer is given, the newest last
    recorded: dict[str, object]  # the newest message of each key that a recording has

    def scenes(self) -> dict[str, PlanningScene]:
        """What each of them has, with all files."""
        self.arm.sim.sleep(0.2)
        meshes = {key: message.data for key, message in self.recorded.items() if key.startswith(scene_mesh("").key)}
        known = {mesh_digest(data): data for data in meshes.values()}
        recorded = self.recorded[SCENE.key]
        assert isinstance(recorded, PlanningScene)
        return {
            "planner": self.keeper.scene,
            "list": self.arm.scene.whole(),
            "page": self.page.scene,
            "viewer": self.viewed[-1],
            "recording": with_meshes(recorded, known),
        }

    def require_one_scene(self) -> PlanningScene:
        scenes = self.scenes()
        for who, scene in scenes.items():
            assert names_of(scene) == names_of(scenes["planner"]), who
            assert scene == scenes["planner"], who
        return scenes["planner"]


@pytest.fixture(scope="module")
def everybody() -> Iterator[Everybody]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planner_main, "SceneKeeper", SeenKeeper)
        with gemelo.simulate("rm1") as arm:
            viewed, recorded = list[PlanningScene](), dict[str, object]()
            viewer, recorder = arm.sim.node("looking"), arm.sim.node("recording")
            viewer.subscribe(SCENE, SceneMeshes(viewer, viewed.append).on_scene)
            Subscriptions(recorder, lambda topic, message: recorded.update({topic.key: message}))
            for node in (viewer, recorder):
                node.begin()
            yield Everybody(arm, KEEPERS.pop(), BusReadings(arm, lambda: None), viewed, recorded)
            viewer.close()
            recorder.close()


def names_of(scene: PlanningScene) -> list[str]:
    return [item.name for item in scene.objects]


def tube(path: Path, size: int) -> Path:
    """A binary STL file of about `size` [bytes]: a tube of 40 mm in the middle of nothing."""
    rows = max(2, round((size / 100) ** 0.5) + 1)
    turns = np.linspace(0.0, 2.0 * np.pi, rows)
    circle = np.stack((0.02 * np.cos(turns), 0.02 * np.sin(turns)), axis=1)
    heights = np.linspace(0.0, 0.05, rows)
    grid = np.concatenate((np.repeat(circle[:, None], rows, 1), np.repeat(heights[None, :, None], rows, 0)), axis=2)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]
    corners = np.concatenate((np.stack((a, b, c), -2), np.stack((b, d, c), -2))).reshape(-1, 3, 3)
    facets = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    facets["corners"] = corners
    path.write_bytes(b"tube".ljust(80) + struct.pack("<I", len(facets)) + facets.tobytes())
    return path


def test_a_mesh_of_ten_megabytes_is_in_everybodys_scene_and_crosses_the_bus_once(
    everybody: Everybody, tmp_path: Path
) -> None:
    arm, scene = everybody.arm, everybody.arm.scene
    file = tube(tmp_path / "part.stl", 10_000_000)
    scene.clear()
    sizes: list[int] = []
    watcher = arm.sim.node("watcher")
    watcher.subscribe(SCENE, lambda message: sizes.append(len(encode(message))))
    watcher.begin()
    scene.add_mesh("part", file, at=FAR)
    scene.add_box("post", (0.1, 0.1, 0.1), at=(0.0, 2.0, 0.0))
    for index in range(5):
        scene.move("part", (3.0, 0.1 * index, 0.0))
    assert everybody.require_one_scene().objects[0].shape == MeshShape(data=file.read_bytes())
    assert max(sizes) < 2000
    shape = scene.objects["part"].shape
    assert isinstance(shape, MeshShape)
    assert (shape.size, shape.data) == (file.stat().st_size, b"")
    arm.move(named="ready")
    watcher.close()


def test_a_scene_with_large_meshes_is_saved_whole_and_comes_back_by_file_and_by_digest(
    everybody: Everybody, tmp_path: Path
) -> None:
    scene = everybody.arm.scene
    scene.clear()
    scene.add_mesh("part", tube(tmp_path / "part.stl", 1_000_000), at=FAR)
    scene.save(tmp_path / "cell.json")
    with scene.restored():
        scene.clear()
        assert names_of(everybody.require_one_scene()) == []
    assert names_of(everybody.require_one_scene()) == ["part"]
    scene.clear()
    scene.load(tmp_path / "cell.json")
    assert everybody.require_one_scene().objects[0].shape == MeshShape(data=(tmp_path / "part.stl").read_bytes())


def test_a_mesh_that_nobody_knows_or_that_is_too_large_is_refused_and_nothing_has_changed(
    everybody: Everybody, tmp_path: Path
) -> None:
    arm = everybody.arm
    arm.scene.clear()
    arm.scene.add_sphere("ball", 0.1, at=FAR)
    before = everybody.require_one_scene()
    with pytest.raises(gemelo.Refused, match='"part": nothing is known of its mesh 0123; add it with its file'):
        arm.scene.edit(gemelo_add("part", MeshShape(digest="0123")))
    with pytest.raises(gemelo.Refused, match=r'"part": its mesh has 32500000 bytes, more than 32000000; simplify it'):
        arm.scene.edit(gemelo_add("part", MeshShape(data=bytes(32_500_000))))
    with pytest.raises(gemelo.Refused, match=r"40000\d+ bytes: a SceneRequest has at most 33554432; add the objects"):
        arm.scene.edit(gemelo_add("part", MeshShape(data=bytes(40_000_000))))
    assert everybody.require_one_scene() == before


def gemelo_add(name: str, shape: MeshShape) -> gemelo.api.scene.SceneAdd:
    return gemelo.api.scene.SceneAdd(object=SceneObject(name=name, shape=shape))


@given(steps=st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from((*SIZES, 0, -1))), min_size=1, max_size=8))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_everybody_has_one_scene_whatever_sizes_are_added_and_removed_around_the_limits(
    everybody: Everybody, tmp_path: Path, steps: list[tuple[str, int]]
) -> None:
    """A size is that of a mesh, 0 removes the object, -1 gives it a long list of what it may touch."""
    arm = everybody.arm
    arm.scene.clear()
    expected: dict[str, bytes] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gemelo.services.planner.collision.scene_shapes.LARGEST_FILE", 42_000)
        patch.setattr("gemelo.services.planner.scene.scene_check.LARGEST_MESHES", 80_000)
        patch.setitem(MAX_PAYLOAD_OF, "SceneRequest", 44_000)
        patch.setitem(MAX_PAYLOAD_OF, "PlanningScene", 1200)
        for name, size in steps:
            wanted = dict(expected)
            try:
                if size == 0:
                    wanted.pop(name, None)
                    arm.scene.remove(name)
                elif size == -1:
                    wanted[name] = b""
                    arm.scene.add_box(
                        name, (0.1,) * 3, at=(0.0, 0.0, 0.3), frame=arm.tool_frame, attach=True,
                        touch=[arm.tool_frame] * 40,
                    )  # fmt: skip
                else:
                    file = tube(tmp_path / f"{name}.stl", size)
                    wanted[name] = file.read_bytes()
                    arm.scene.add_mesh(name, file, at=FAR)
                expected = wanted
            except gemelo.Refused as refused:
                assert any(words in str(refused.reason) for words in ("more than", "at most", "no object"))  # noqa: PT017
            shown = everybody.require_one_scene()
            assert {item.name: getattr(item.shape, "data", b"") for item in shown.objects} == expected


def test_an_edit_that_fails_in_the_planner_is_an_error_and_leaves_every_scene_as_it_was(everybody: Everybody) -> None:
    arm = everybody.arm
    arm.scene.clear()
    arm.scene.add_sphere("ball", 0.1, at=FAR)
    before, keeper = everybody.require_one_scene(), everybody.keeper
    for broken in ("_built", "_with_jaws", "_contacts_here", "_take_opening", "_prepared"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(keeper, broken, fail)
            with pytest.raises(gemelo.Refused, match="planner failed: ZeroDivisionError: oh"):
                arm.scene.add_box("post", (0.1, 0.1, 0.1), at=FAR)
        assert everybody.require_one_scene() == before, broken
    arm.scene.add_box("post", (0.1, 0.1, 0.1), at=FAR)
    assert names_of(everybody.require_one_scene()) == ["ball", "post"]


def fail(*_: object) -> None:
    raise ZeroDivisionError("oh")


def test_a_recording_has_each_mesh_once_however_often_the_scene_changes(everybody: Everybody, tmp_path: Path) -> None:
    arm = everybody.arm
    arm.scene.clear()
    sizes: list[int] = []
    recorder = arm.sim.node("another")
    recorder.subscribe(exchange_topic(SCENE_EDIT), lambda exchange: sizes.append(size_of(exchange)))
    recorder.begin()
    arm.scene.add_mesh("part", tube(tmp_path / "part.stl", 300_000), at=FAR)
    arm.scene.move("part", (3.0, 1.0, 0.0))
    arm.sim.sleep(0.2)
    assert [size > 300_000 for size in sizes] == [True, False]
    recorder.close()
    moved = SceneRequest(edit=SceneMove(name="part"))
    assert len(encode(moved)) < 300
    assert by_digest(everybody.require_one_scene()) == arm.scene.present


def size_of(exchange: Exchange) -> int:
    return len(encode(exchange))


def test_a_box_has_no_digest() -> None:
    scene = PlanningScene(objects=(SceneObject(name="b", shape=BoxShape(size=(1.0, 1.0, 1.0))),))
    assert by_digest(scene) is scene
