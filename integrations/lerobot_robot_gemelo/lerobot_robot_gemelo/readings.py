"""The newest states of joints and gripper, at once: `arm.joints` waits for what was measured after the last change."""

from __future__ import annotations

import gemelo

OLDEST = 0.5  # [s] chosen: an arm that rests reports 10 times a second


class Readings:
    """What one arm has reported last; the first look waits for the first report."""

    def __init__(self, arm: gemelo.Arm) -> None:
        self._arm = arm
        self._joints = arm.node.latest(gemelo.topics.JOINT_STATES)
        self._gripper = arm.node.latest(gemelo.topics.GRIPPER_STATE)

    @property
    def joints(self) -> dict[str, float]:
        """[rad] or [m] by joint; raises `gemelo.Lost` where nothing is reported any more."""
        state = self._joints.message
        if state is None or self._joints.age() > OLDEST:
            return self._arm.joints
        return dict(zip(state.name, state.position, strict=True))

    @property
    def opening(self) -> float:
        """[m] between the jaws; raises `gemelo.Lost`."""
        state = self._gripper.message
        if state is None or self._gripper.age() > OLDEST:
            return self._arm.gripper.position
        return state.position

    @property
    def opening_wanted(self) -> float:
        """[m] between the jaws to which they go; raises `gemelo.Lost`."""
        state = self._gripper.message
        return self._arm.gripper.target if state is None or self._gripper.age() > OLDEST else state.target
