"""The page of arms that are not in the repository: two joints in a plane, of which one slides, and seven."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.panel.model.tool_turns import ALL_RINGS, NO_RINGS, ToolTurns, tool_turns
from gemelo.services.panel.model.units import STEP, meant, shown, slider_range
from gemelo.services.panel.words.en import ENGLISH
from tests.arm.bare_arm import ROBOT, write_bare_arm
from tests.panel.memory_page import MemoryPage, memory_page

IN_ITS_PLANE = (True, True, False)


def write_seven_joints(folder: Path) -> Path:
    """An arm with an elbow that moves while its tool stands, without pictures of its links."""
    axes = ("0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
    links = ("base", *(f"link_{number}" for number in range(1, 7)), "hand")
    joints = "".join(
        f'<joint name="joint_{number}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.15"/><axis xyz="{axis}"/><limit lower="-2.5" upper="2.5" effort="9" velocity="1"/></joint>'
        for number, (parent, child, axis) in enumerate(zip(links, links[1:], axes, strict=False))
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.toml").write_text(ROBOT)
    (folder / "robot.urdf").write_text(
        f'<robot name="bare">{"".join(f"<link name={name!r}/>" for name in links)}{joints}</robot>'
    )
    home = "".join(f'<joint name="joint_{number}" value="0"/>' for number in range(len(axes)))
    (folder / "robot.srdf").write_text(
        '<robot name="bare"><group name="arm"><chain base_link="base" tip_link="hand"/></group>'
        f'<group_state name="home" group="arm">{home}</group_state></robot>'
    )
    return folder


def test_the_arrows_and_jog_buttons_of_an_arm_in_a_plane_lead_nowhere_else(tmp_path: Path):
    polar = tool_turns(load_arm(write_bare_arm(tmp_path / "polar")))
    assert (polar.arrows, polar.along_base, polar.rings) == (IN_ITS_PLANE, IN_ITS_PLANE, NO_RINGS)
    seven = tool_turns(load_arm(write_seven_joints(tmp_path / "seven")))
    assert seven == ToolTurns(ALL_RINGS, keeps_orientation=True, arrows=ALL_RINGS, along_base=ALL_RINGS)


@pytest.fixture(params=[write_bare_arm, write_seven_joints], ids=["two joints", "seven joints"])
def page(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[MemoryPage]:
    with memory_page(request.param(tmp_path / "robot"), tmp_path) as page:
        yield page


def test_every_tab_is_there_with_a_slider_and_two_jog_buttons_for_each_joint(page: MemoryPage):
    page.draw(10)
    page.sent()
    assert page.browser is not None
    arm = page.panel.operator.arm.description
    labels = page.browser.labels
    for joint in arm.joints:
        assert {f"{joint.name} +", f"{joint.name} -"} <= labels
    z = {label for label in labels if label.startswith("z ")}
    assert bool(z) is page.panel.operator.goal.turns.along_base[2]
    assert ENGLISH["plan_and_execute"] in labels
    [shown_page] = page.panel.pages()
    sliders = shown_page.move.sliders
    assert set(sliders) == set(arm.joint_names)
    for joint in arm.joints:
        slider = sliders[joint.name]
        assert slider.label == f"{joint.name} [{'mm' if joint.unit == 'm' else '°'}]"
        assert (slider.min, slider.max) == slider_range(joint)
        assert slider.step == STEP[joint.unit]
        wanted = shown(joint, page.gateway.joints[joint.name])
        assert slider.value == round(slider.value, 1) == pytest.approx(wanted, abs=0.05 + 1e-9)


def test_a_slider_s_value_means_degrees_or_millimetres_and_never_leaves_the_limits(tmp_path: Path):
    for joint in load_arm(write_bare_arm(tmp_path)).joints:
        lower, upper = slider_range(joint)
        for value in (lower, upper, 0.5 * (lower + upper), -1e9, 1e9):
            assert joint.is_within(meant(joint, value))
        assert shown(joint, meant(joint, 0.5 * (lower + upper))) == pytest.approx(0.5 * (lower + upper))
