"""The files that a user of ROS copies: they name what the bridge serves, and what the arm has."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.deployment import RosSection
from gemelo.services.ros_bridge.motion import GRIPPER_ACTION

FOLDER = Path(__file__).parents[2] / "docs/ros"


def test_moveit_s_controllers_are_the_actions_of_the_bridge_with_the_joints_of_rm1(rm1: ArmDescription) -> None:
    found = yaml.safe_load((FOLDER / "moveit_controllers.yaml").read_text())
    controllers = found["moveit_simple_controller_manager"]
    actions = {f"{name}/{controllers[name]['action_ns']}" for name in controllers["controller_names"]}
    assert actions == {f"{RosSection().controller}/follow_joint_trajectory", GRIPPER_ACTION}
    assert tuple(controllers["arm_controller"]["joints"]) == rm1.joint_names
    coarsest = max(1.0 / joint.steps.per_unit for joint in rm1.joints)
    assert found["trajectory_execution"]["allowed_start_tolerance"] > coarsest
    assert coarsest == pytest.approx(0.0157, abs=1e-4)


def test_rviz_shows_the_description_in_the_arm_s_base_frame(rm1: ArmDescription) -> None:
    found = yaml.safe_load((FOLDER / "gemelo.rviz").read_text())["Visualization Manager"]
    assert found["Global Options"]["Fixed Frame"] == rm1.base_frame
    topic = next(each["Description Topic"] for each in found["Displays"] if "Description Topic" in each)
    assert (topic["Value"], topic["Durability Policy"]) == ("/robot_description", "Transient Local")
    assert {each["Topic"]["Value"] for each in found["Displays"] if "Topic" in each} == {
        f"/{RosSection().node}/{name}" for name in ("scene", "planned_path")
    }


def test_the_launch_file_starts_rviz_on_the_router_of_ros() -> None:
    launch = ElementTree.parse(FOLDER / "gemelo.launch.xml").getroot()
    variables = {each.attrib["name"]: each.attrib["value"] for each in launch.iter("set_env")}
    assert variables["RMW_IMPLEMENTATION"] == "rmw_zenoh_cpp"
    assert variables["ZENOH_CONFIG_OVERRIDE"] == 'mode="client";connect/endpoints=["$(var router)"]'
    (node,) = launch.iter("node")
    assert (FOLDER / node.attrib["args"].rpartition("/")[2]).is_file()
