"""Configurations of the arm as poses of its moving links."""

from __future__ import annotations

import numpy as np

from gemelo.services.visualizer.content.updates import Poses, Times, Update
from gemelo.services.visualizer.model.rotations import Array
from gemelo.services.visualizer.model.visual_model import VisualModel


def arm_poses(model: VisualModel, root: str, times: Times, rows: Array) -> list[Update]:
    """The arm under `root` in the configurations `rows` (n, joints), in the order of `model.moving`, at `times`
    (n,)."""
    names = [joint.name for joint in model.moving]
    return [
        Poses(f"{root}/{model.paths[joint.child]}", times, *joint.poses(model.positions(joint, rows, names)))
        for joint in model.joints
        if joint.is_moving
    ]


def arm_pose_at(model: VisualModel, root: str, now: int, configuration: Array) -> list[Update]:
    """The arm under `root` in one `configuration` (joints,) [rad] or [m] from `now` [ns] on."""
    return arm_poses(model, root, np.array([now], dtype=np.int64), configuration[None, :])
