"""Keys, tokens, qualities of service and attachments, by string: as rmw_zenoh_cpp writes and reads them."""

from __future__ import annotations

import pytest
import xxhash

from gemelo.libraries.runtime.ros_wire.names import (
    DEFAULT,
    FRAMES,
    LATCHED,
    Attachment,
    EntityKind,
    NodeName,
    RosType,
    data_key,
    endpoint_token,
    gid_of,
    node_token,
    read_attachment,
    read_token,
)

JOINTS = RosType("sensor_msgs/msg/JointState", "RIHS01_a13e")
NODE = NodeName("gemelo")
SESSION = "8f7c0100"


def test_the_key_of_a_topic_has_domain_name_type_and_hash():
    assert data_key(0, "/joint_states", JOINTS) == "0/joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_a13e"
    assert data_key(7, "/rm1/joint_states", JOINTS).startswith("7/rm1/joint_states/sensor_msgs::")


@pytest.mark.parametrize(
    ("qos", "text"), [(DEFAULT, "::,10:,:,:,,"), (LATCHED, ":1:,1:,:,:,,"), (FRAMES, "::,100:,:,:,,")]
)
def test_a_quality_of_service_has_six_fields_and_leaves_defaults_out(qos, text):
    assert str(qos) == text


def test_the_tokens_of_a_node_and_of_its_publisher():
    assert node_token(NODE, SESSION) == f"@ros2_lv/0/{SESSION}/0/0/NN/%/%/gemelo"
    assert endpoint_token(NODE, SESSION, 1, EntityKind.PUBLISHER, "/joint_states", JOINTS, DEFAULT) == (
        f"@ros2_lv/0/{SESSION}/0/1/MP/%/%/gemelo/%joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_a13e/"
        "::,10:,:,:,,"
    )


def test_a_namespace_stands_in_tokens_and_before_relative_names_alone():
    node = NodeName("gemelo", "cell/rm1", 3)
    assert node_token(node, SESSION) == f"@ros2_lv/3/{SESSION}/0/0/NN/%/%cell%rm1/gemelo"
    assert node.full("joint_states") == "/cell/rm1/joint_states"
    assert node.full("/tf") == "/tf"
    assert node.full("~/stop") == "/cell/rm1/gemelo/stop"


def test_what_was_written_is_read_again_also_with_parts_that_a_newer_ros_appends():
    token = endpoint_token(NodeName("gemelo", "rm1"), SESSION, 4, EntityKind.SERVER, "/rm1/a/b", JOINTS, DEFAULT)
    for each in (token, f"{token}/backends:cpu:"):
        found = read_token(each)
        assert found is not None
        assert found == (
            SESSION,
            "SS",
            "/rm1/gemelo",
            0,
            "/rm1/a/b",
            "sensor_msgs::msg::dds_::JointState_",
            JOINTS.hash,
        )
    found = read_token(node_token(NODE, SESSION))
    assert found is not None
    assert found[:4] == (SESSION, "NN", "/gemelo", 0)


@pytest.mark.parametrize("key", ["", "@ros2_lv/0/a/0/0/NN", "@alive/local/planner", "@ros2_lv/x/a/0/0/NN/%/%/b",
                                 "@ros2_lv/0/a/0/1/MP/%/%/b/%topic"])  # fmt: skip
def test_what_is_no_token_of_ros_is_none(key):
    assert read_token(key) is None


def test_an_attachment_is_33_bytes_and_another_form_is_none():
    written = Attachment(1, 2, bytes(range(16))).packed()
    assert written == b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + bytes(range(16))
    assert read_attachment(written) == (1, 2, bytes(range(16)))
    assert read_attachment(written[:-1]) is None
    assert read_attachment(written[:16] + b"\x0f" + written[17:]) is None


def test_a_gid_is_the_hash_of_the_token_with_the_low_half_first():
    token = node_token(NODE, SESSION)
    big = xxhash.xxh3_128_digest(token.encode())
    assert gid_of(token) == big[::-1]
