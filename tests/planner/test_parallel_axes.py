"""The closed form of arms of three parallel axes: complete, exact, in any order of the joints, turning either way."""

from __future__ import annotations

import dataclasses
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.parallel_axes import parallel_axes
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER

RM1 = Path(__file__).parents[2] / "urdf" / "rm1"
BASE, UPPER, FORE, TOOL = "base_link", "brazo_link", "antebrazo_link", "efector_link"
SHOULDER, ELBOW, SLIDE = "brazo_joint", "antebrazo_joint", "efector_joint"


def with_joint(urdf: str, name: str, pattern: str, instead: str) -> str:
    """The description with something else within one joint."""
    begin = urdf.index(f'<joint name="{name}"')
    end = urdf.index("</joint>", begin)
    changed, count = re.subn(pattern, instead, urdf[begin:end])
    assert count == 1
    return urdf[:begin] + changed + urdf[end:]


def rechained(urdf: str, order: tuple[str, ...]) -> str:
    """The joints in another order between the same links, and a tool that sticks out."""
    for name, parent, child in zip(order, (BASE, UPPER, FORE), (UPPER, FORE, TOOL), strict=True):
        urdf = with_joint(urdf, name, r'<parent link="\w+"', f'<parent link="{parent}"')
        urdf = with_joint(urdf, name, r'<child link="\w+"', f'<child link="{child}"')
    tip = '<joint name="tip" type="fixed"><parent link="efector_link"/><child link="tip_link"/>'
    return urdf.replace("</robot>", f'<link name="tip_link"/>{tip}<origin xyz="0.1 0.05 0.02"/></joint></robot>')


VARIANTS = {
    "as it is": lambda urdf: urdf,
    "the elbow turns the other way": lambda urdf: with_joint(urdf, ELBOW, r'<axis xyz="0 0 1"', '<axis xyz="0 0 -1"'),
    "leaning": lambda urdf: with_joint(urdf, SHOULDER, r'rpy="0 0 0"', 'rpy="0.4 -0.3 0.2"'),
    "the slide first": lambda urdf: rechained(urdf, (SLIDE, SHOULDER, ELBOW)),
    "the slide between": lambda urdf: rechained(urdf, (SHOULDER, SLIDE, ELBOW)),
}


def arm_of(folder: Path, urdf: str) -> ArmDescription:
    shutil.copytree(RM1, folder)
    (folder / "robot.urdf").write_text(urdf)
    if "tip_link" in urdf:
        settings = (folder / "robot.toml").read_text()
        (folder / "robot.toml").write_text(settings.replace('tool_frame = "efector_link"', 'tool_frame = "tip_link"'))
    return load_arm(folder)


@pytest.fixture(params=VARIANTS, ids=lambda name: name.replace(" ", "-"))
def arm(request: pytest.FixtureRequest, tmp_path: Path) -> ArmDescription:
    return arm_of(tmp_path / "arm", VARIANTS[request.param]((RM1 / "robot.urdf").read_text()))


def test_every_configuration_is_found_again_and_every_answer_is_right(arm: ArmDescription):
    kinematics = Kinematics(arm)
    assert parallel_axes(arm, kinematics) is not None
    inverse, random = InverseKinematics(arm, kinematics), np.random.default_rng(3)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    for configuration, near in random.uniform(lower, upper, (60, 2, 3)):
        position = kinematics.tool(configuration).position
        found = list(inverse.solutions(ToolTarget(position), near, NEVER))
        assert min(np.abs(each - configuration).max() for each in found) < 1e-6
        travels = [inverse.travel(near, each) for each in found]
        assert travels == sorted(travels)
        for each in found:
            assert np.linalg.norm(kinematics.tool(each).position - position) < 1e-7
            assert all(joint.is_within(value) for joint, value in zip(arm.joints, each.tolist(), strict=True))


def test_the_order_of_the_joints_in_robot_toml_does_not_matter():
    arm = load_arm(RM1)
    backwards = dataclasses.replace(arm, joints=arm.joints[::-1])
    configuration = np.array((0.5, -1.2, 0.1))
    kinematics = Kinematics(backwards)
    position = kinematics.tool(configuration[::-1]).position
    found = list(InverseKinematics(backwards, kinematics).solutions(ToolTarget(position), configuration[::-1], NEVER))
    assert np.allclose(found[0], configuration[::-1])


def test_a_slide_without_limits_goes_as_far_as_it_takes():
    arm = load_arm(RM1)
    joints = [dataclasses.replace(j, lower=-math.inf, upper=math.inf) if j.unit == "m" else j for j in arm.joints]
    kinematics = Kinematics(arm)
    solver = parallel_axes(dataclasses.replace(arm, joints=tuple(joints)), kinematics)
    assert solver is not None
    far = np.array((0.5, -1.2, 40.0))
    position = kinematics.tool(far).position
    assert min(np.abs(each - far).max() for each in solver.configurations(position, np.zeros(3))) < 1e-9


def test_it_finds_what_a_search_finds_and_no_less():
    arm = load_arm(RM1)
    kinematics = Kinematics(arm)
    inverse, searching = InverseKinematics(arm, kinematics), InverseKinematics(arm, kinematics, is_numeric=True)
    random = np.random.default_rng(4)
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    for configuration, near in random.uniform(lower, upper, (20, 2, 3)):
        target = ToolTarget(kinematics.tool(configuration).position)
        found = list(inverse.solutions(target, near, NEVER))
        for searched in searching.solutions(target, near, NEVER):
            assert min(np.abs(searched - each).max() for each in found) < 1e-4


def test_an_arm_whose_axes_are_not_parallel_has_none(tmp_path: Path):
    urdf = with_joint((RM1 / "robot.urdf").read_text(), ELBOW, r'<axis xyz="0 0 1"', '<axis xyz="0 0.1 0.995"')
    arm = arm_of(tmp_path / "arm", urdf)
    assert parallel_axes(arm, Kinematics(arm)) is None


def test_an_arm_with_its_tool_on_the_axis_of_the_elbow_has_none(tmp_path: Path):
    urdf = with_joint((RM1 / "robot.urdf").read_text(), SLIDE, r'xyz="0.20445 0.001 -0.13418"', 'xyz="0 0 -0.13418"')
    arm = arm_of(tmp_path / "arm", urdf)
    assert parallel_axes(arm, Kinematics(arm)) is None


def test_the_stretched_arm_has_one_configuration_and_beyond_it_there_is_none():
    arm = load_arm(RM1)
    kinematics = Kinematics(arm)
    solver = parallel_axes(arm, kinematics)
    assert solver is not None
    stretched = np.array((0.3, 0.0, 0.1))
    stretched[1] = -math.atan2(0.001, 0.20445) - math.atan2(0.00037, 0.20188)  # the links' own offsets
    position = kinematics.tool(stretched).position
    assert min(np.abs(each - stretched).max() for each in solver.configurations(position, stretched)) < 1e-6
    assert len(solver.configurations(position * (1.0001, 1.0001, 1.0), stretched)) == 0
