"""Restrictions of an arm's motion are used or named as left out: soft limits, followers, an SRDF, joint_limits.yaml."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.checks.urdf import check_urdf
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.srdf import read_srdf
from gemelo.libraries.arm.model.srdf_edit import entries
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.libraries.robot_import.survey import Survey, surveyed
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.plain_arm import BOTH, LIMIT, arm, body, boxes, hinge, hinges, part

JAW = '<geometry><box size="0.01 0.004 0.03"/></geometry>'


def survey(source: Path, **given: str) -> Survey:
    return surveyed(find_source(source), Questions(given, takes_defaults=True))


def ends(found: Survey, name: str) -> tuple[float, float]:
    assert found.description is not None, list(map(str, found.findings))
    limit = found.description.mended.model.joint(name).limit
    assert limit is not None
    return limit.lower, limit.upper


def said_of(found: Survey, words: str) -> str:
    (said,) = (str(each) for each in found.findings if words in str(each))
    return said


SAFETY = '<safety_controller k_position="20" k_velocity="10" soft_lower_limit="{}" soft_upper_limit="{}"/>'
SOFT = {
    "narrower": ("-1.0", "1.0", (-1.0, 1.0), 'its soft limits -1 to 1 are within its limits -2 to 2 -> lower="-1"'),
    "on one side": ("-9", "0.5", (-2.0, 0.5), 'upper="0.5"'),
    "wider": ("-9", "9", (-2.0, 2.0), "are not within its limits -2 to 2 -> the limits hold"),
    "the same": ("-2", "2", (-2.0, 2.0), "its soft limits -2 to 2 are its limits -> left out"),
    "rounded": ("-1.99999", "2.00001", (-2.0, 2.0), "its soft limits -1.99999 to 2.00001 are its limits -> left out"),
    "none": ("0", "0", (-2.0, 2.0), "has no soft limits -> left out"),
    "beyond the limits": ("5", "6", (-2.0, 2.0), "leave no travel within its limits -2 to 2 -> left out"),
}


@pytest.mark.parametrize(("low", "high", "expected", "words"), SOFT.values(), ids=list(SOFT))
def test_a_joint_moves_within_its_soft_limits(
    tmp_path: Path, low: str, high: str, expected: tuple[float, float], words: str
):
    found = survey(arm(tmp_path, boxes(), hinges(j3=LIMIT + SAFETY.format(low, high))))
    assert ends(found, "j3") == expected
    assert words in said_of(found, "soft limits")
    assert "line 9" in said_of(found, "soft limits")


def test_soft_limits_of_a_joint_that_turns_without_end_are_named_as_left_out(tmp_path: Path):
    last = hinge("j3", "fore", "hand", LIMIT + SAFETY.format(-1, 1), kind="continuous")
    parts = (boxes(), hinge("j1", "base", "upper"), hinge("j2", "upper", "fore"), last)
    found = survey(arm(tmp_path, *parts))
    assert "its soft limits -1 to 1 are of a continuous joint" in said_of(found, "of a continuous")


def test_calibration_marks_are_named_as_left_out(tmp_path: Path):
    found = survey(arm(tmp_path, boxes(), hinges(j1=LIMIT + '<calibration rising="0.3"/>')))
    assert 'line 7: joint "j1": its <calibration rising="0.3">' in said_of(found, "calibration")


def jaws(folder: Path, own: float, multiplier: float = 1.0) -> Path:
    """An arm with two jaws, of which the follower's own limit is `own` [m]."""
    parts = [part("left", body("visual", JAW) + body("collision", JAW)), part("right", body("visual", JAW))]
    slide = '<limit lower="0" upper="0.03" effort="5" velocity="0.02"/>'
    follows = (
        f'<limit lower="0" upper="{own}" effort="5" velocity="0.02"/><mimic joint="jaw" multiplier="{multiplier}"/>'
    )
    parts += [hinge("jaw", "hand", "left", slide, kind="prismatic")]
    parts += [hinge("jaw2", "hand", "right", follows, kind="prismatic")]
    return arm(folder, boxes(), hinges(), *parts)


@pytest.mark.parametrize(
    ("own", "multiplier", "expected"), [(0.012, 1.0, 0.012), (0.03, 2.0, 0.015), (0.03, 1.0, 0.03)]
)
def test_a_jaw_leads_its_follower_no_farther_than_the_follower_may(
    tmp_path: Path, own: float, multiplier: float, expected: float
):
    found = survey(jaws(tmp_path, own, multiplier))
    assert ends(found, "jaw") == (0.0, expected)
    assert len([each for each in found.findings if "beyond its own limits" in each.message]) == (expected < 0.03)
    assert not [each for each in check_urdf(found.description.mended.model, tmp_path) if "follows" in each.message]  # type: ignore[union-attr]


def test_a_follower_without_any_travel_that_its_limits_allow_is_an_error(tmp_path: Path):
    found = survey(jaws(tmp_path, 0.03, -1.0))
    assert [each.severity for each in found.findings if "beyond its own limits" in each.message] == [Severity.ERROR]


SRDF = """<robot name="{name}"><group name="manipulator"><chain base_link="base" tip_link="fore"/></group>
<group name="wrist"><joint name="j3"/></group><group name="all"><group name="manipulator"/><joint name="j3"/></group>
<group_state name="stow" group="all"><joint name="j1" value="0.1"/><joint name="j2" value="1.5"/>
<joint name="j3" value="-1.5"/></group_state>
<group_state name="bent" group="wrist"><joint name="j3" value="0.7"/></group_state>
<group_state name="far" group="wrist"><joint name="j3" value="2.7"/></group_state>
<group_state name="home" group="manipulator"><joint name="j1" value="0"/><joint name="j2" value="0.3"/></group_state>
{more}<disable_collisions link1="hand" link2="base" reason="User"/>
<disable_collisions link1="hand" link2="nothing" reason="Never"/></robot>"""


def test_the_srdf_beside_it_gives_its_states_groups_pairs_and_tool(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """And `--yes` finds its way: what cannot be used of it is named."""
    arm(tmp_path / "in")
    (tmp_path / "in" / "config").mkdir()
    (tmp_path / "in" / "config" / "arm.srdf").write_text(SRDF.format(name="arm", more='<virtual_joint name="v"/>'))
    (tmp_path / "in" / "config" / "arm.srdf.xacro").write_text(SRDF.format(name="arm", more=""))
    assert run(["import", str(tmp_path / "in"), "--yes", "--output", str(tmp_path / "urdf")]) is ExitCode.OK
    said = capsys.readouterr().out
    loaded = load_arm(tmp_path / "urdf" / "arm")
    assert loaded.named_states["stow"] == (0.1, 1.5, -1.5)
    assert loaded.named_states["home"][:2] == (0.0, 0.3)
    assert loaded.named_state("bent", (0.2, 0.3, 0.0)) == (0.2, 0.3, 0.7)
    assert loaded.tool_frame == "hand"
    groups = {group.name: group.joints for group in read_srdf(loaded.srdf_path).groups}
    assert groups == {"arm": ("j1", "j2", "j3"), "manipulator": ("j1", "j2"), "wrist": ("j3",)}
    reasons = {tuple(sorted(each.pair)): each.reason for each in entries(loaded.srdf_path.read_text())}
    assert reasons["base", "hand"] == "of the SRDF: User"
    for words in (
        'arm.srdf: state "far": j3 = 2.7 is beyond its limits -2 to 2 -> left out',
        'arm.srdf: disable_collisions: it names link "nothing", which the URDF does not have -> left out',
        "arm.srdf: <virtual_joint>: 1 of these say nothing that is used here -> left out",
        "arm.srdf.xacro: is an SRDF in xacro -> left out: expand it",
        "pair base and hand: the SRDF excuses it, and it comes as near as",
    ):
        assert words in said, said


def test_an_srdf_of_another_robot_is_named_as_left_out(tmp_path: Path):
    source = arm(tmp_path)
    (tmp_path / "other.srdf").write_text(SRDF.format(name="other", more=""))
    (tmp_path / "broken.srdf").write_text("<robot")
    found = survey(source)
    assert 'other.srdf: is of robot "other", not of "arm" -> left out' in said_of(found, "other.srdf")
    assert "cannot be read" in said_of(found, "broken.srdf")
    assert found.description is not None
    assert found.description.mended.semantics is None


def test_passive_joints_of_the_srdf_stand_still(tmp_path: Path):
    source = arm(tmp_path)
    (tmp_path / "arm.srdf").write_text(SRDF.format(name="arm", more='<passive_joint name="j2"/>'))
    found = survey(source)
    assert found.description is not None
    assert [joint.name for joint in found.description.joints] == ["j1", "j3"]
    assert 'no motor moves "j2"' in said_of(found, "passive_joint")


def test_an_srdf_in_xacro_is_no_robot(tmp_path: Path):
    source = arm(tmp_path)
    text = source.read_text().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    (tmp_path / "arm.urdf.xacro").write_text(text)
    source.unlink()
    srdf = SRDF.format(name="arm", more="").replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    for name in ("arm.srdf.xacro", "semantic.xacro"):
        (tmp_path / name).write_text(srdf)
    assert find_source(tmp_path).urdf.name == "arm.urdf.xacro"


LIMITS = """
/**:
  ros__parameters:
    robot_description_planning:
      default_velocity_scaling_factor: 0.1
      joint_limits:
        j1: {has_velocity_limits: true, max_velocity: 0.5, has_acceleration_limits: true, max_acceleration: 0.25}
        j2: {has_position_limits: true, min_position: -0.5, max_position: !degrees 90}
        j3: {has_velocity_limits: false, max_velocity: 0.01, has_jerk_limits: true, max_jerk: 3.0}
        j9: {has_velocity_limits: true, max_velocity: 1.0}
"""


def test_moveits_joint_limits_hold_and_what_is_not_used_of_them_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    arm(tmp_path / "in")
    (tmp_path / "in" / "config").mkdir()
    (tmp_path / "in" / "config" / "joint_limits.yaml").write_text(LIMITS)
    (tmp_path / "in" / "config" / "pilz_cartesian_limits.yaml").write_text("cartesian_limits: {}")
    assert run(["import", str(tmp_path / "in"), "--yes", "--output", str(tmp_path / "urdf")]) is ExitCode.OK
    said = capsys.readouterr().out
    loaded = load_arm(tmp_path / "urdf" / "arm")
    first, second, third = loaded.joints
    assert (first.velocity, first.acceleration) == pytest.approx((0.5, 0.25))
    assert (second.lower, second.upper) == (-0.5, pytest.approx(1.5707963))
    assert (third.lower, third.velocity) == pytest.approx((-2.0, 1.0))
    for words in (
        'joint "j1": joint_limits.yaml beside it limits it further -> velocity="0.5", 0.25 rad/s^2',
        'joint "j3": joint_limits.yaml limits its jerk to 3 -> left out',
        'joint_limits.yaml: it limits joint "j9", which the URDF does not have -> left out',
        "joint_limits.yaml: default_velocity_scaling_factor is 0.1 -> left out",
        "pilz_cartesian_limits.yaml: limits the speed of the tool",
    ):
        assert words in said, said


def test_of_nine_joints_those_that_carry_the_tool_are_driven_and_the_rest_is_held(tmp_path: Path):
    names = [f"l{number}" for number in range(10)]
    parts = [part(name, BOTH) for name in names]
    parts += [hinge(f"q{number}", names[number - 1], names[number]) for number in range(1, 10)]
    found = survey(arm(tmp_path, *parts))
    assert found.description is not None
    assert [joint.name for joint in found.description.joints] == [f"q{number}" for number in range(2, 10)]
    assert "9 joints move, and a device drives 8: q1 of them stands still" in said_of(found, "a device drives 8")
    some = survey(arm(tmp_path, *parts), driven_joints="q1, q2 q9")
    assert some.description is not None
    assert [joint.name for joint in some.description.joints] == ["q1", "q2", "q9"]
    with pytest.raises(ValueError, match=re.escape('"q77" is no joint that moves')):
        survey(arm(tmp_path, *parts), driven_joints="q77")
