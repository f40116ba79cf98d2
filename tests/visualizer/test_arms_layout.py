"""Several arms in one view: each has its own entities, its own scene beside the others, and a tab with all of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.joints import JointState
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.model.urdf import parse_urdf
from gemelo.services.visualizer.render.arms_layout import arms_blueprint
from gemelo.services.visualizer.render.layout import ArmLayout, blueprint
from gemelo.services.visualizer.render.sink import Sink
from tests.visualizer.listener import Listener, views

NAMES = ("rm1", "parol6")
names = st.text(min_size=1, max_size=8).filter(lambda name: "/" not in name and name.isprintable())


@pytest.fixture(scope="module")
def layouts() -> dict[str, ArmLayout]:
    arms = {name: load_arm(project_root() / "urdf" / name) for name in NAMES}
    return {
        name: ArmLayout(parse_urdf(arm.urdf_path.read_text()), window=20.0, trail=20.0, robot=name)
        for name, arm in arms.items()
    }


@pytest.fixture(scope="module")
def said(layouts) -> dict[str, set[str]]:
    """Which entities each arm's visualizer writes, static and of a moment."""
    told = {}
    for name, layout in layouts.items():
        listener = Listener()
        sink = Sink(listener, layout.model, Path("urdf", name), arms_blueprint(tuple(layouts.values())), name)
        core = Visualizer(layout.model, name, layout.model.joints[-1].child)
        joints = tuple(joint.name for joint in layout.model.moving)
        core.on_joint_state(JointState(stamp=10**18, name=joints, position=(0.0,) * len(joints)))
        sink.write(core.step(10**18))
        told[name] = {*listener.said, *(entity for entity, _ in listener.sent)}
    return told


def test_everything_of_an_arm_stands_under_its_name(said):
    for name, entities_told in said.items():
        assert len(entities_told) > 20
        assert all(entity.startswith(f"{name}/") for entity in entities_told)


@given(names, names)
def test_no_entity_of_one_arm_is_or_contains_one_of_another(first, second):
    one, other = (entities.under(name, entities.WORLD).split("/") for name in (first, second))
    assert (one == other) is (first == second)
    assert len(one) == len(other) == 2


def test_an_arm_alone_has_its_entities_without_a_name():
    assert entities.under("", entities.MEASURED) == entities.MEASURED


def test_every_view_is_of_one_arm_and_shows_what_that_arms_visualizer_writes(layouts, said):
    for view in views(arms_blueprint(tuple(layouts.values())).root_container):
        (name,) = (name for name in NAMES if view.origin.startswith(f"{name}/"))
        is_below = any(entity == view.origin or entity.startswith(f"{view.origin}/") for entity in said[name])
        assert is_below or view.origin == f"{name}/{entities.LOG}" or view.origin == f"{name}/{entities.PANEL}"


def test_the_first_tab_has_scene_step_errors_mode_and_log_of_every_arm_beside_one_another(layouts):
    tabs = arms_blueprint(tuple(layouts.values())).root_container
    together, *alone = tabs.contents
    assert (together.name, [each.name for each in alone]) == ("All arms", list(NAMES))
    for column, (name, layout) in zip(together.contents, layouts.items(), strict=True):
        scene, errors, mode, log = views(column)
        assert (scene.origin, mode.origin, log.origin) == (f"{name}/world", f"{name}/device/mode", f"{name}/log")
        assert all(view.name.startswith(name) for view in (scene, errors, mode, log))
        of_joints = {f"{name}/{entities.error(joint.name)}": joint.name for joint in layout.model.moving}
        assert errors.contents == [f"+ /{entity}" for entity in of_joints]
        assert {entity: first_series(lines) for entity, lines in errors.visualizer_overrides.items()} == of_joints


def test_the_tab_of_an_arm_has_all_that_it_has_in_a_view_of_its_own(layouts):
    _, *alone = arms_blueprint(tuple(layouts.values())).root_container.contents
    for tab, (name, layout) in zip(alone, layouts.items(), strict=True):
        own = blueprint(ArmLayout(layout.model, layout.window, layout.trail)).root_container
        assert [(v.origin, v.name) for v in views(tab)] == [(f"{name}/{v.origin}", v.name) for v in views(own)]


def first_series(lines: Any) -> str:
    return str(lines.names.as_arrow_array().to_pylist()[0])
