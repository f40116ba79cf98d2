"""A robot's folder as one `ArmDescription`, held against readers that others wrote, and its refusals."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import pinocchio as pin
import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from tests.arm.editing import edit


def test_rm1_is_what_the_seed_says(rm1: ArmDescription):
    assert rm1.name == "rm1"
    assert rm1.joint_names == ("brazo_joint", "antebrazo_joint", "efector_joint")
    assert [joint.wire_name for joint in rm1.joints] == ["q1", "q2", "q3"]
    assert [(j.lower, j.upper, j.unit) for j in rm1.joints] == [
        (-2.95, 2.95, "rad"),
        (-2.95, 2.95, "rad"),
        (0, 0.2, "m"),
    ]
    assert rm1.named_states["home"] == (0.0, 0.0, 0.0) == rm1.reference_position
    assert rm1.device.name == "rm1"


def test_the_light_reader_agrees_with_pinocchio(rm1: ArmDescription):
    model = pin.buildModelFromUrdf(str(rm1.urdf_path))
    assert list(model.names)[1:] == list(rm1.joint_names)
    assert model.lowerPositionLimit.tolist() == [j.lower for j in rm1.joints]
    assert model.upperPositionLimit.tolist() == [j.upper for j in rm1.joints]
    masses = [link.inertial.mass for link in rm1.model.links if link.inertial]
    assert masses == [1.395, 0.465, 0.338, 0.065] == [inertia.mass for inertia in model.inertias]


def test_the_light_reader_agrees_with_yourdfpy(rm1: ArmDescription):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import yourdfpy

        robot = yourdfpy.URDF.load(str(rm1.urdf_path), load_meshes=False, build_scene_graph=False).robot
    assert [link.name for link in robot.links] == list(rm1.model.link_names)
    for theirs, ours in zip(robot.joints, rm1.model.joints, strict=True):
        assert (theirs.name, theirs.type, theirs.parent, theirs.child) == (
            ours.name,
            ours.kind,
            ours.parent,
            ours.child,
        )
        assert tuple(theirs.axis) == ours.axis
        assert ours.limit is not None
        assert (theirs.limit.lower, theirs.limit.upper) == (ours.limit.lower, ours.limit.upper)
        assert (theirs.limit.effort, theirs.limit.velocity) == (ours.limit.effort, ours.limit.velocity)
    for theirs, ours in zip(robot.links, rm1.model.links, strict=True):
        assert ours.inertial is not None
        assert theirs.inertial.mass == ours.inertial.mass
        assert len(theirs.collisions) == len(ours.collisions)


def test_an_unknown_key_names_file_line_key_and_the_nearest_one(copy: Path):
    edit(copy / "robot.toml", "pulses_per_turn = 400\ngear_ratio", "pulses_per_tern = 400\ngear_ratio")
    with pytest.raises(DescriptionError, match=r"line 119: .*joint\[0\].motor.pulses_per_tern.*pulses_per_turn"):
        load_arm(copy)


def test_a_wrong_type_names_the_key(copy: Path):
    edit(copy / "robot.toml", "tick_hz = 50_000", 'tick_hz = "fast"')
    with pytest.raises(DescriptionError, match=r"robot.toml, line 14: .*int.*device.tick_hz"):
        load_arm(copy)


PULL_OUT = """[joint.motor.pull_out]
speed = [0, 1000, 2000, 4000, 6000, 8000, 10000]
torque = [1.2, 1.15, 1.0, 0.7, 0.45, 0.28, 0.15]
inertia = 7.5e-5
friction = 0.05
"""


@pytest.mark.parametrize(
    ("new", "sentence"),
    [
        ("pull_out = {speed = [0], torque = [1], inertia = 1, frition = 0.05}", r"line 124: .*motor.pull_out.frition`"),
        ("pull_out = {speed = [0,\n 1000], torque = [1, 1], inertia = inf}", r"line 125: .*pull_out.inertia` is inf"),
        ("pull_out.speed = [\n 0,\n 1000, # slow\n -2000,\n]", r"line 127: .*>= 0.0 - at `.*pull_out.speed\[2\]`"),
    ],
)
def test_a_line_is_found_within_inline_tables_and_arrays_of_several_lines(copy: Path, new: str, sentence: str):
    edit(copy / "robot.toml", PULL_OUT, new + "\n")
    with pytest.raises(DescriptionError, match=sentence):
        load_arm(copy)


@pytest.mark.parametrize(
    ("file", "old", "new", "sentence"),
    [
        (
            "robot.toml",
            'name = "brazo_joint"',
            'name = "braso_joint"',
            r'"braso_joint": is not in the URDF; did you',
        ),
        ("robot.toml", 'driver = "DM542T"', 'driver = "DM556"', r'no \[\[driver\]\] "DM556"'),
        (
            "robot.toml",
            "ramp_time = 1.0",
            "ramp_time = inf",
            r"line 104: `joint\[0\].ramp_time` is inf: it must be finite",
        ),
        ("robot.toml", "step_low_us = 1.0", "step_low_us = 0.0", r"line 33: .*> 0.0 - at `\$.driver\[1\].step_low_us"),
        ("robot.toml", 'wire_name = "q2"', 'wire_name = "q1"', 'joint "q1": this wire_name is there 2 times'),
        ("robot.toml", 'tool_frame = "efector_link"', 'tool_frame = "tool"', 'tool_frame "tool" is no link'),
        (
            "robot.toml",
            'transmission = "rack_and_pinion"',
            'transmission = "rotary"',
            "write transmission = .rack_and_pinion.",
        ),
        ("robot.toml", 'gear_ratio = "46.656"', 'gear_ratio = "46,656"', "neither a decimal nor a fraction"),
        ("robot.urdf", 'upper="0.2"', 'upper="0"', "leave no travel"),
        ("robot.urdf", 'effort="17" velocity="0.05"', 'effort="17" velocity="0"', "velocity limit is 0"),
        ("robot.urdf", 'xyz="0.20188 -0.00037 0.15187"', 'xyz="0.2 zero 0.1"', '"zero" is not a number'),
        ("robot.urdf", '<axis xyz="0 0 -1"/>', '<axis xyz="0 0 0"/>', "axis is zero"),
        ("robot.urdf", 'type="prismatic"', 'type="slide"', 'type "slide" is not one of'),
        ("robot.urdf", "</robot>", "", "not XML"),
        ("robot.srdf", '<joint name="brazo_joint" value="0"/>', "", 'state "home" has no value for brazo_joint'),
    ],
)
def test_a_bad_file_ends_in_a_sentence(copy: Path, file: str, old: str, new: str, sentence: str):
    edit(copy / file, old, new)
    with pytest.raises(DescriptionError, match=sentence):
        load_arm(copy)


def test_a_folder_without_a_robot_says_so(tmp_path: Path):
    with pytest.raises(DescriptionError, match="no such file"):
        load_arm(tmp_path)


def test_the_mechanics_narrow_the_limits(copy: Path):
    edit(copy / "robot.toml", "mechanical_upper = 3.1", "mechanical_upper = 1.5")
    joint = load_arm(copy).joint("brazo_joint")
    assert (joint.lower, joint.upper) == (-2.95, 1.5)


def test_a_continuous_joint_has_no_limits(copy: Path):
    edit(copy / "robot.urdf", 'name="brazo_joint" type="revolute"', 'name="brazo_joint" type="continuous"')
    joint = load_arm(copy).joint("brazo_joint")
    assert (joint.lower, joint.upper, joint.unit) == (-math.inf, math.inf, "rad")


def test_a_joint_that_is_not_there_is_named_with_the_nearest(rm1: ArmDescription):
    with pytest.raises(DescriptionError, match='no joint "brazo"; did you mean "brazo_joint"'):
        rm1.joint("brazo")
