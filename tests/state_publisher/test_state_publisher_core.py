"""Joint states in, frames out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.frames.frame_buffer import FrameBuffer
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.joints import JointState
from gemelo.services.state_publisher.core import StatePublisher

STAMP = 1_700_000_000_123_456_789


def state(arm: ArmDescription, *position: float, stamp: int = STAMP) -> JointState:
    return JointState(stamp=stamp, name=arm.joint_names, position=position)


def test_frames_carry_the_states_own_stamp(rm1: ArmDescription):
    found = StatePublisher(rm1).on_joint_state(state(rm1, 0.1, 0.2, 0.03))
    assert found.frames is not None
    assert [(f.stamp, f.parent, f.child) for f in found.frames.transforms] == [
        (STAMP, "base_link", "brazo_link"),
        (STAMP, "brazo_link", "antebrazo_link"),
        (STAMP, "antebrazo_link", "efector_link"),
    ]


def test_the_frames_put_the_tool_where_pinocchio_has_it(rm1: ArmDescription):
    publisher, kinematics, generator = StatePublisher(rm1), Kinematics(rm1), np.random.default_rng(3)
    for _ in range(100):
        q = generator.uniform([j.lower for j in rm1.joints], [j.upper for j in rm1.joints])
        buffer = FrameBuffer()
        frames = publisher.on_joint_state(state(rm1, *q.tolist())).frames
        assert frames is not None
        buffer.insert_all(frames)
        assert buffer.look_up("base_link", "efector_link").translation == pytest.approx(
            kinematics.tool(q).position, abs=1e-9
        )


def test_the_order_of_names_is_theirs(rm1: ArmDescription):
    publisher = StatePublisher(rm1)
    turned = JointState(stamp=STAMP, name=tuple(reversed(rm1.joint_names)), position=(0.03, 0.2, 0.1))
    assert publisher.on_joint_state(turned).frames == publisher.on_joint_state(state(rm1, 0.1, 0.2, 0.03)).frames


def test_an_unknown_joint_is_dropped_counted_and_said_once(rm1: ArmDescription):
    publisher = StatePublisher(rm1)
    strange = JointState(stamp=STAMP, name=("braso_joint", *rm1.joint_names), position=(9.0, 0.1, 0.2, 0.03))
    first, second = publisher.on_joint_state(strange), publisher.on_joint_state(strange)
    assert '"braso_joint" is no moving joint of rm1; did you mean "brazo_joint"?' in first.warnings[0]
    assert second.warnings == ()
    assert publisher.dropped["braso_joint"] == 2
    assert first.frames == publisher.on_joint_state(state(rm1, 0.1, 0.2, 0.03)).frames


def test_a_state_whose_sizes_differ_is_dropped_and_said_once(rm1: ArmDescription):
    publisher = StatePublisher(rm1)
    bad = JointState(stamp=STAMP, name=rm1.joint_names, position=(0.0,))
    assert "3 names with 1 positions" in publisher.on_joint_state(bad).warnings[0]
    assert publisher.on_joint_state(bad).warnings == ()
    assert publisher.dropped["sizes"] == 2


def test_a_part_of_the_joints_gives_their_frames_only(rm1: ArmDescription):
    frames = StatePublisher(rm1).on_joint_state(JointState(name=("brazo_joint",), position=(1.0,))).frames
    assert frames is not None
    assert [f.child for f in frames.transforms] == ["brazo_link"]


def test_an_empty_state_gives_nothing(rm1: ArmDescription):
    assert StatePublisher(rm1).on_joint_state(JointState()).frames is None


def test_rm1_has_no_fixed_links(rm1: ArmDescription):
    assert StatePublisher(rm1).static_frames(STAMP).transforms == ()


def test_fixed_links_are_static_and_mimics_follow(tmp_path: Path):
    joint = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="1 0 0"/>{4}</joint>'
    limit = '<limit lower="0" upper="1" effort="1" velocity="1"/>'
    mimic = '<mimic joint="left" multiplier="-1" offset="1"/>'
    (tmp_path / "robot.urdf").write_text(
        '<robot name="grip"><link name="base"/><link name="left"/><link name="right"/><link name="eye"/>'
        + joint.format("left", "prismatic", "base", "left", limit)
        + joint.format("right", "prismatic", "base", "right", limit + mimic)
        + joint.format("eye", "fixed", "left", "eye", '<origin xyz="1 2 3"/>')
        + "</robot>"
    )
    (tmp_path / "robot.srdf").write_text('<robot name="grip"/>')
    (tmp_path / "robot.toml").write_text(
        'name = "grip"\nbase_frame = "base"\ntool_frame = "eye"\n[device]\nname = "grip"\n'
        '[[driver]]\nname = "d"\nstep_high_us = 1.0\nstep_low_us = 1.0\ndir_setup_us = 1.0\n'
        '[[joint]]\nname = "left"\nwire_name = "q"\ntransmission = "rack_and_pinion"\npinion_radius = 0.1\n'
        '[joint.motor]\ndriver = "d"\npulses_per_turn = 400\n'
    )
    publisher = StatePublisher(load_arm(tmp_path))
    (eye,) = publisher.static_frames(STAMP).transforms
    assert (eye.parent, eye.child, eye.transform.translation) == ("left", "eye", (1.0, 2.0, 3.0))
    frames = publisher.on_joint_state(JointState(name=("left",), position=(0.25,))).frames
    assert frames is not None
    assert {f.child: f.transform.translation[0] for f in frames.transforms} == {"left": 0.25, "right": 0.75}
