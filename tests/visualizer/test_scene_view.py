"""The planning scene on the screen: objects, what is attached, and what touches where a plan was refused."""

from __future__ import annotations

import subprocess
from pathlib import Path

import msgspec
import numpy as np
import pytest
import rerun as rr

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.jaws import JAWS, jaw_objects
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.scene import (
    BoxShape,
    Contact,
    Contacts,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    Shape,
    SphereShape,
)
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.content.scene import SceneView
from gemelo.services.visualizer.content.updates import ClearEntity, Labels, Poses, SolidMesh, TranslucentArm
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.model.mesh_files import scene_mesh
from gemelo.services.visualizer.model.visual_model import VisualModel
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.sink import APPLICATION, Sink

NOW = 1_795_000_000_000_000_000
NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")
TOOL = "base_link/brazo_link/antebrazo_link/efector_link"
TRIANGLE = b"solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"

TABLE = SceneObject(name="table", shape=BoxShape(size=(0.6, 0.4, 0.02)), pose=Transform(translation=(0.3, 0.0, -0.01)))
CUP = SceneObject(name="cup", shape=CylinderShape(radius=0.03, length=0.08), frame="efector_link", attached=True)


@pytest.fixture
def view(model: VisualModel) -> SceneView:
    return SceneView(model, lambda shape: scene_mesh(shape, (), lambda text: None))


def touching(*pairs: tuple[str, str]) -> Contacts:
    contacts = tuple(Contact(first=a, second=b, distance=-0.001, point=(0.1, 0.2, 0.3)) for a, b in pairs)
    return Contacts(stamp=NOW, name=NAMES, position=(0.5, 0.2, 0.01), contacts=contacts)


def things(view: SceneView) -> dict[str, SolidMesh]:
    return {update.entity: update for update in view.take(NOW) if isinstance(update, SolidMesh)}


def test_what_stands_is_in_the_world_and_what_is_carried_moves_with_its_link(view):
    view.on_scene(PlanningScene(objects=(TABLE, CUP)))
    shown = things(view)
    assert list(shown) == ["world/scene/table", f"world/measured/{TOOL}/carried/cup"]
    table = shown["world/scene/table"]
    assert table.translation == (0.3, 0.0, -0.01)
    assert np.ptp(table.mesh.vertices, axis=0).tolist() == pytest.approx([0.6, 0.4, 0.02])
    assert view.take(NOW) == []


def test_only_what_changes_is_told_again(view):
    view.on_scene(PlanningScene(objects=(TABLE, CUP)))
    view.take(NOW)
    moved = SceneObject(name="table", shape=TABLE.shape, pose=Transform(translation=(0.4, 0.0, 0.0)))
    view.on_scene(PlanningScene(objects=(moved, CUP)))
    assert list(things(view)) == ["world/scene/table"]
    view.restart()
    assert len(things(view)) == 2


def test_what_is_taken_away_or_let_go_is_gone_from_where_it_was(view):
    view.on_scene(PlanningScene(objects=(TABLE, CUP)))
    view.take(NOW)
    free = SceneObject(name="cup", shape=CUP.shape)
    view.on_scene(PlanningScene(objects=(free,)))
    updates = view.take(NOW)
    gone = [update.entity for update in updates if isinstance(update, ClearEntity)]
    assert gone[:2] == ["world/scene/table", f"world/measured/{TOOL}/carried/cup"]
    assert [update.entity for update in updates if isinstance(update, SolidMesh)] == ["world/scene/cup"]


def test_the_jaws_are_drawn_on_the_tool_as_far_apart_as_they_are(view):
    arm = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
    for opening in (0.05, 0.01):
        view.on_jaws(jaw_objects(arm, opening))
        drawn = things(view)
        first, second = (next(mesh for entity, mesh in drawn.items() if entity.endswith(name)) for name in JAWS)
        assert "efector_link" in first.entity
        assert first.translation[1] - second.translation[1] == pytest.approx(opening + 0.006)
    view.on_jaws(jaw_objects(arm, 0.01))
    assert things(view) == {}


@pytest.mark.parametrize(
    ("shape", "extent"),
    [
        (SphereShape(radius=0.1), (0.2, 0.2, 0.2)),
        (CylinderShape(radius=0.1, length=0.5), (0.2, 0.2, 0.5)),
        (PlaneShape(), (2.0, 2.0, 0.004)),
        (MeshShape(data=TRIANGLE, scale=(0.5, 0.2, 1.0)), (0.5, 0.2, 0.0)),
    ],
)
def test_every_shape_is_drawn_at_its_size(view, shape: Shape, extent):
    view.on_scene(PlanningScene(objects=(SceneObject(name="thing", shape=shape),)))
    mesh = things(view)["world/scene/thing"].mesh
    assert np.ptp(mesh.vertices, axis=0).tolist() == pytest.approx(extent, abs=1e-2)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    if isinstance(shape, PlaneShape):
        assert mesh.vertices[:, 2].max() == 0.0


def test_padding_is_drawn_too(view):
    view.on_scene(PlanningScene(objects=(SceneObject(name="ball", shape=SphereShape(radius=0.1), padding=0.05),)))
    assert np.ptp(things(view)["world/scene/ball"].mesh.vertices[:, 2]) == pytest.approx(0.3)


def test_a_mesh_that_cannot_be_read_is_said_once_and_left_out(model):
    said: list[str] = []
    view = SceneView(model, lambda shape: scene_mesh(shape, (Path("nowhere"),), said.append))
    view.on_scene(PlanningScene(objects=(SceneObject(name="m", shape=MeshShape(path="m.stl")), TABLE)))
    assert list(things(view)) == ["world/scene/table"]
    view.restart()
    view.take(NOW)
    assert len(said) == 1
    assert '"m.stl"' in said[0]


def test_a_refused_configuration_shows_what_touches_in_red_with_its_names(view):
    view.on_scene(PlanningScene(objects=(TABLE, CUP)))
    view.take(NOW)
    view.on_contacts(touching(("efector_link", "table"), ("cup", "table")))
    updates = view.take(NOW)
    red = {update.entity for update in updates if isinstance(update, SolidMesh) and update.color == palette.IN_CONTACT}
    assert red == {"world/scene/table", f"world/refused/{TOOL}/carried/cup"}
    [shadow] = [update for update in updates if isinstance(update, TranslucentArm)]
    assert "efector_link" in shadow.touching
    assert shadow.color == palette.REFUSED_ARM
    poses = [update.entity for update in updates if isinstance(update, Poses)]
    assert f"world/refused/{TOOL}" in poses
    [labels] = [update for update in updates if isinstance(update, Labels)]
    assert labels.texts == (
        "efector_link and table: 1.0 mm inside one another\ncup and table: 1.0 mm inside one another",
        "",
    )


def test_when_nothing_touches_any_more_the_shadow_goes_and_the_red_too(view):
    view.on_scene(PlanningScene(objects=(TABLE,)))
    view.on_contacts(touching(("efector_link", "table")))
    view.take(NOW)
    view.on_contacts(Contacts(stamp=NOW))
    updates = view.take(NOW)
    [table] = [update for update in updates if isinstance(update, SolidMesh)]
    assert table.color == palette.OBJECT
    assert [update.entity for update in updates if isinstance(update, ClearEntity)] == [entities.REFUSED]
    assert not any(isinstance(update, TranslucentArm | Labels) for update in updates)


def test_the_configuration_that_was_refused_is_gone_as_soon_as_the_arm_goes(model):
    shown = Visualizer(model, "rm1", "efector_link")
    shown.scene.on_scene(PlanningScene(objects=(TABLE,)))
    shown.scene.on_contacts(touching(("efector_link", "table")))
    names = tuple(joint.name for joint in model.moving)
    still = JointState(stamp=NOW, name=names, position=(0.0,) * len(names), velocity=(0.0,) * len(names))
    shown.on_joint_state(still)
    assert any(isinstance(update, Labels) for update in shown.step(NOW))
    shown.on_joint_state(msgspec.structs.replace(still, velocity=(0.1,) * len(names)))
    updates = shown.step(NOW + 1)
    assert entities.REFUSED in [update.entity for update in updates if isinstance(update, ClearEntity)]
    assert not any(isinstance(update, TranslucentArm | Labels) for update in updates)


@pytest.mark.parametrize("name", ["table", "box 1", "a/b", "..", "größe", "a_b-c.d", "ö*", 'say "x"'])
def test_any_name_is_one_part_of_an_entity_path_as_rerun_has_it(name):
    assert entities.part(name) == rr.escape_entity_path_part(name)


def test_scene_and_contacts_reach_the_recording(model, tmp_path):
    path = tmp_path / "scene.rrd"
    stream = rr.RecordingStream(APPLICATION, recording_id="scene")
    stream.save(str(path))
    core = Visualizer(model, "rm1", "efector_link")
    sink = Sink(stream, model, tmp_path, blueprint(ArmLayout(model, 20.0, 20.0)))
    core.scene.on_scene(PlanningScene(objects=(TABLE, CUP, SceneObject(name="box 1", shape=SphereShape(radius=0.1)))))
    core.scene.on_contacts(touching(("efector_link", "table")))
    sink.write(core.step(NOW))
    sink.close()
    printed = subprocess.run([rerun_binary(), "rrd", "print", path], capture_output=True, text=True, check=True).stdout
    expected = [
        "/world/scene/table", "/world/scene/box\\ 1", f"/world/measured/{TOOL}/carried/cup",
        f"/world/refused/{TOOL}/visual_0", f"/world/refused/{TOOL}/carried/cup", "/world/refused/contacts",
    ]  # fmt: skip
    for entity in expected:
        assert entity in printed
