"""`gemelo scene`, from its words to the planner's scene, on a bus in memory."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import encode
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    SphereShape,
)
from gemelo.schemas.scene_meshes import mesh_digest
from gemelo.schemas.topics import JOINT_STATES, SCENE
from gemelo.services.planner.scene.answer_log import AnswerLog
from gemelo.services.planner.scene.scene_keeper import SceneKeeper
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.main import run
from gemelo.tools.cli.robot import scene as scene_module
from gemelo.tools.cli.robot.scene import attach_choices, pair_choices
from tests.runtime.support import until

Said = Callable[[str], ExitCode]
TRIANGLE = "solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"


@pytest.fixture
def keeper(arm, network, deployment, session, connected, monkeypatch, tmp_path) -> Iterator[None]:
    """A planner's scene on the same bus, with an arm at rest; the commands reach it."""

    @contextmanager
    def connect_arm(robot=None):
        with reported(load_robot()):
            yield connected

    monkeypatch.setattr(scene_module, "connect_arm", connect_arm)
    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        log = AnswerLog(node, lambda: False)
        SceneKeeper(node, arm, node.latest(JOINT_STATES), tmp_path, lambda world: None, log)
        states = session.node.publisher(JOINT_STATES)

        def stand(now: int) -> None:
            states.put(JointState(stamp=now, name=arm.joint_names, position=(0.0,) * len(arm.joints)))

        thread = threading.Thread(target=lambda: node.spin(stand, rate=20.0))
        thread.start()
        yield
        node.stop()
        thread.join()


@pytest.fixture
def scene(session, keeper) -> Callable[[], PlanningScene]:
    latest = session.node.latest(SCENE)

    def newest() -> PlanningScene:
        session.node.wait(0.1)
        assert latest.message is not None
        return latest.message

    return newest


def said(line: str) -> ExitCode:
    return run(line.split())


def test_shapes_places_and_turns_have_units(scene):
    assert said("scene add table --box 600mm 0.4 20mm --at -300mm 0 -0.01 --rpy 0 0 90deg --padding 5mm") is ExitCode.OK
    [table] = scene().objects
    assert table.shape == BoxShape(size=(0.6, 0.4, 0.02))
    assert table.pose.translation == pytest.approx((-0.3, 0.0, -0.01))
    assert table.pose.rotation == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    assert table.padding == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("words", "shape"),
    [
        ("--sphere 50mm", SphereShape(radius=0.05)),
        ("--cylinder 0.1 200mm", CylinderShape(radius=0.1, length=0.2)),
        ("--plane", PlaneShape()),
    ],
)
def test_every_shape_can_be_added_and_given_to_another(scene, words, shape):
    assert said(f"scene add thing {words}") is ExitCode.OK
    assert scene().objects[0].shape == shape
    said("scene add other --box 1 1 1")
    assert said(f"scene resize other {words}") is ExitCode.OK
    assert scene().objects[1].shape == shape


def test_a_mesh_outside_the_project_travels_by_its_content(scene, tmp_path):
    (tmp_path / "plate.stl").write_text(TRIANGLE)
    assert said(f"scene add plate --mesh {tmp_path / 'plate.stl'} --scale 0.001") is ExitCode.OK
    content = TRIANGLE.encode()
    shape = MeshShape(digest=mesh_digest(content), size=len(content), scale=(0.001, 0.001, 0.001))
    assert scene().objects[0].shape == shape


def test_a_mesh_in_millimetres_is_noticed_and_its_scale_is_listed(scene, tmp_path, capsys):
    path = tmp_path / "plate.stl"
    path.write_text(TRIANGLE.replace("1", "92"))
    assert said(f"scene add plate --mesh {path}") is ExitCode.USAGE
    assert "would be 92 m long: if it is drawn in mm, give --scale 0.001" in capsys.readouterr().err
    assert said(f"scene add plate --mesh {path} --scale 0.001") is ExitCode.OK
    assert f"mesh of {path.stat().st_size} bytes, scale 0.001, 92 x 92 x 0 mm large, at" in capsys.readouterr().out
    assert scene().objects[0].shape.scale == (0.001,) * 3
    assert said("scene list") is ExitCode.OK
    assert f"mesh of {path.stat().st_size} bytes, scale 0.001" in capsys.readouterr().out


def test_a_mesh_that_may_be_in_centimetres_is_asked_for(scene, tmp_path, capsys):
    path = tmp_path / "plate.stl"
    path.write_text(TRIANGLE.replace("1", "8"))
    assert said(f"scene add plate --mesh {path}") is ExitCode.USAGE
    wanted = "would be 8 m long: in mm, cm or inches, give --scale 0.001, 0.01 or 0.0254; if it is so large, --scale 1"
    assert wanted in capsys.readouterr().err
    for scale in ("0.01", "1"):
        assert said(f"scene add plate --mesh {path} --scale {scale}") is ExitCode.OK
        assert scene().objects[0].shape.scale == (float(scale),) * 3


def test_an_object_is_carried_moved_and_let_go(scene):
    said("scene add cup --sphere 20mm --at 0.3 0 0.1")
    assert said("scene attach cup efector_link --touch antebrazo_link brazo_link") is ExitCode.OK
    [cup] = scene().objects
    assert (cup.frame, cup.attached, cup.touch_links) == ("efector_link", True, ("antebrazo_link", "brazo_link"))
    assert said("scene move cup --at 0 0 -20mm --frame efector_link") is ExitCode.OK
    assert scene().objects[0].pose.translation == pytest.approx((0.0, 0.0, -0.02))
    assert said("scene detach cup") is ExitCode.OK
    assert not scene().objects[0].attached
    assert said("scene remove cup") is ExitCode.OK
    assert scene().objects == ()


def test_an_object_can_be_put_into_the_hand_at_once(scene):
    assert said("scene add cup --sphere 20mm --attach efector_link --at 0 0 40mm --touch antebrazo_link") is ExitCode.OK
    [cup] = scene().objects
    assert cup == SceneObject(
        name="cup", shape=SphereShape(radius=0.02), pose=cup.pose, frame="efector_link", attached=True,
        touch_links=("antebrazo_link",),
    )  # fmt: skip
    assert cup.pose.translation == (0.0, 0.0, 0.04)


def test_pairs_are_allowed_and_disallowed(scene):
    said("scene add table --plane")
    assert said("scene allow table *") is ExitCode.OK
    assert scene().allowed == (AllowedPair(first="table", second="*"),)
    assert said("scene disallow * table") is ExitCode.OK
    assert scene().allowed == ()


def test_a_saved_scene_is_loaded_again(scene, tmp_path, capsys):
    said("scene add table --box 1 1 0.1")
    said("scene add cup --sphere 20mm --attach efector_link")
    said("scene allow table cup")
    before = scene()
    assert said(f"scene save {tmp_path / 'cell.json'}") is ExitCode.OK
    assert f"cell.json has the scene, version {before.version}" in capsys.readouterr().out
    assert said("scene clear") is ExitCode.OK
    assert scene().objects == ()
    assert said(f"scene load {tmp_path / 'cell.json'}") is ExitCode.OK
    assert (scene().objects, scene().allowed) == (before.objects, before.allowed)


def test_the_list_says_what_is_there(scene, capsys):
    said("scene add table --box 600mm 400mm 20mm --at 300mm 0 -10mm --padding 3mm")
    said("scene add cup --cylinder 30mm 80mm --attach efector_link --touch brazo_link")
    said("scene allow table cup")
    capsys.readouterr()
    assert said("scene list") is ExitCode.OK
    text = capsys.readouterr().out
    assert "box 600 x 400 x 20" in text
    assert "300.0 0.0 -10.0" in text
    assert "efector_link (attached)" in text
    assert "table and cup may touch" in text
    assert said("scene list --json") is ExitCode.OK
    assert [item["name"] for item in json.loads(capsys.readouterr().out)["objects"]] == ["table", "cup"]


def test_an_empty_scene_is_said_to_be_empty(scene, capsys):
    assert said("scene list") is ExitCode.OK
    assert capsys.readouterr().out == "nothing is around the arm\nversion 0\n"


@pytest.mark.parametrize(
    ("line", "code", "reason"),
    [
        ("scene remove tabel", ExitCode.FAILED, 'refused: there is no object "tabel"; did you mean "table"?'),
        ("scene add ball --sphere 0", ExitCode.FAILED, 'refused: object "ball": radius of the sphere is 0 m'),
        ("scene add ball --sphere 3deg", ExitCode.USAGE, "--sphere: 3deg must be in m or mm"),
        ("scene add ball --sphere 1 --rpy 0 0 90", ExitCode.USAGE, "--rpy: 90 what: 90deg or 90rad?"),
        ("scene add ball --sphere 1 --rpy 0 0 1.5", ExitCode.USAGE, "--rpy: 1.5 what: 1.5deg or 1.5rad?"),
        ("scene add ball --sphere 1 --rpy 0 0 90rad", ExitCode.USAGE, "more than a turn: write 90deg for degrees"),
        ("scene add ball --mesh nowhere.stl", ExitCode.USAGE, 'there is no file "nowhere.stl"'),
        ("scene load nowhere.json", ExitCode.USAGE, "nowhere.json cannot be read"),
        ("scene attach table efector_link", ExitCode.FAILED, 'refused: object "table" is a plane'),
        ("scene allow * *", ExitCode.FAILED, "allows everything to touch everything"),
    ],
)
def test_what_cannot_be_is_one_sentence(scene, capsys, line, code, reason):
    said("scene add table --plane")
    assert said(line) is code
    assert reason in capsys.readouterr().err


def test_a_file_that_is_no_scene_is_refused(tmp_path: Path, capsys):
    (tmp_path / "bad.json").write_text('{"objects": [{"shape": {"type": "cone"}}]}')
    assert said(f"scene load {tmp_path / 'bad.json'}") is ExitCode.USAGE
    assert "holds no scene" in capsys.readouterr().err


def test_completion_knows_the_kept_objects_and_the_links(monkeypatch, tmp_path):
    monkeypatch.setenv("GEMELO_PATHS_RUN", str(tmp_path))
    robot = load_robot()
    assert attach_choices(robot) == {"": []}
    (tmp_path / "scene.json").write_text('{"objects": [{"name": "cup"}, {"name": "two words"}]}')
    words = attach_choices(robot)
    assert words[""] == ["cup"]
    assert "efector_link" in words["cup"]
    assert "cup" in pair_choices(robot)["efector_link"]


def test_a_stray_scene_under_the_planners_name_is_answered_with_the_planners_own(scene, network):
    """Else whoever follows the stray one refuses the plans of the planner for good."""
    own = scene()
    stray = MemoryBus(network).publish(SCENE.key, "PlanningScene", SCENE.delivery, "planner")
    stray.put(encode(PlanningScene(version=7, epoch=own.epoch + 1)))
    assert scene().epoch != own.epoch
    assert until(lambda: scene() == own)
