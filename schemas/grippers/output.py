"""A gripper that an output of the controller board drives."""

from __future__ import annotations

from gemelo.schemas.grippers.gripper import GripperRecord, SwitchDrive
from gemelo.schemas.robot_record import Positive


class OutputGripper(GripperRecord, frozen=True, kw_only=True, tag_field="kind", tag="output"):
    """A valve or a relay: open or closed, and nothing says when it is there but its travel time."""

    output: str  # name of an [[output]]
    closes: bool = True  # False: switched on, it opens
    travel_time: Positive = 0.3  # [s] from one end to the other

    @property
    def drive(self) -> SwitchDrive:
        return SwitchDrive(
            output=self.output, open=self.open, closed=self.closed, closes=self.closes, travel_time=self.travel_time
        )
