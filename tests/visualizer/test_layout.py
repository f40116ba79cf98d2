"""The first sight of the viewer: every view named with its unit, the ghost translucent, the band in the plot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import rerun as rr

from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.updates import Tint
from gemelo.services.visualizer.model.urdf import parse_urdf
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.sink import Sink
from tests.visualizer.listener import Listener, views


@pytest.fixture
def named(model) -> dict[str, str]:
    """Origin of each view -> its name."""
    return {view.origin: view.name for view in views(blueprint(ArmLayout(model, 20.0, 20.0)).root_container)}


@pytest.fixture
def said(model, tmp_path: Path) -> dict[str, list[Any]]:
    listener = Listener()
    Sink(listener, model, tmp_path, blueprint(ArmLayout(model, 20.0, 20.0)))
    return listener.said


def test_arm_device_mode_and_log_have_their_views(named):
    assert (
        named[entities.WORLD]
        == "Twin: measured (solid), commanded (blue), planned arm and way (cyan), what touches (red) [m]"
    )
    assert (named[entities.PANEL], named[entities.MODE]) == ("Device", "Mode of the device")
    assert named[entities.LOG] == "Log"
    assert entities.PATH.startswith(entities.WORLD)


def test_every_joint_has_a_plot_of_position_and_of_step_error_with_units(named, model):
    for joint, unit in zip(model.moving, ("°", "°", "mm"), strict=True):
        assert named[entities.position(joint.name)] == f"{joint.name} · position [{unit}]"
        assert named[entities.error(joint.name)] == f"{joint.name} · step error [steps]"


def test_series_say_what_they_are_and_the_band_is_half_a_step(said, model):
    for joint in model.moving:
        assert series(said[entities.executed(joint.name)]) == ["executed"]
        assert series(said[entities.commanded(joint.name)]) == ["commanded"]
        assert series(said[entities.error(joint.name)]) == ["commanded - executed", "+0.5 step", "-0.5 step"]
        assert series(said[entities.shaft(joint.name)]) == ["lost steps: true shaft - counter"]


def test_the_measured_arm_is_solid_and_the_commanded_one_a_translucent_ghost(said, model, tmp_path):
    ghost = alphas(said, entities.COMMANDED)
    assert len(ghost) > 3
    assert max(ghost) < 128
    assert len(colors_in(model, tmp_path, "IDLE")) == len(ghost)
    assert {color & 0xFF for color in colors_in(model, tmp_path, "IDLE")} == {255}


def test_the_measured_arm_is_red_in_fault_and_its_own_colours_otherwise(model, tmp_path):
    red = 0xD63030FF
    assert set(colors_in(model, tmp_path, "ESTOP")) == set(colors_in(model, tmp_path, "FAULT")) == {red}
    own = colors_in(model, tmp_path, "IDLE")
    assert red not in own
    assert len(set(own)) > 1


def test_meshes_keep_the_colours_of_their_files_but_in_fault(rm1_folder):
    rm1 = parse_urdf((rm1_folder / "robot.urdf").read_text())
    assert colors_in(rm1, rm1_folder, "IDLE") == []
    assert len(colors_in(rm1, rm1_folder, "FAULT")) >= len(rm1.visuals)


def colors_in(model, folder: Path, mode: str) -> list[int]:
    """0xRRGGBBAA of every visual of the measured arm in a mode of the device."""
    listener = Listener()
    layout = blueprint(ArmLayout(model, 20.0, 20.0))
    Sink(listener, model, folder, layout).write([Tint(entities.MEASURED, 0, mode)])
    return [
        color for entity, columns in listener.sent if entity.startswith(f"{entities.MEASURED}/") for color in columns
    ]


def series(things: list[Any]) -> list[str]:
    (lines,) = [thing for thing in things if isinstance(thing, rr.SeriesLines)]
    return lines.names.as_arrow_array().to_pylist()


def alphas(said: dict[str, list[Any]], root: str) -> list[int]:
    """The opacity, 0 to 255, of every mesh under `root`; a colour is 0xRRGGBBAA."""
    things = [thing for entity, told in said.items() if entity.startswith(f"{root}/") for thing in told]
    return [t.albedo_factor.as_arrow_array().to_pylist()[0] & 0xFF for t in things if isinstance(t, rr.Mesh3D)]
