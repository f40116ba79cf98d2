"""English of the refusals in the units of the page: by the check that refused, as `es_refusals`.

A check without a template here is told in the planner's own words, which say more of it.
"""

from __future__ import annotations

REFUSALS: dict[str, str] = {
    # where the arm is or would be
    "joint_limit": "{subject}: {value} is beyond its limit of {limit}.",
    "start_state": "{subject} stands at {value}, beyond its limit of {limit}: move it back by hand, and declare the "
    "reference again.",
    "moving_start": "{subject} moves at {value}, and a plan begins at rest: wait, or press Stop.",
    "joint_state": "The newest state of the arm is {value} old, more than {limit}: where it is is not known. See "
    "whether the device is connected.",
    "joint_state_unknown": "No state of the arm has come yet. See whether the device is connected.",
    # where the tool can be
    "reach": "That point is {value} out of reach of the tool.",
    "reach_axis": "The tool reaches {limit} in {subject}, not {value}: that is {beyond} out of reach.",
    "orientation": "The tool cannot be turned so: {value} are missing.",
    "orientation_unknown": "The tool cannot be turned so.",
    # what would touch
    "collision": "{first} and {second} would be {value} apart; {limit} must stay free.",
    "collision_inside": "{first} and {second} would touch: {value} of one inside the other.",
    "collision_touch": "{first} and {second} would touch.",
    "collision_unknown": "{first} and {second} would be too near to one another.",
    "self_collision": "{first} and {second}, both of the arm, would be {value} apart; {limit} must stay free.",
    "self_collision_inside": "{first} and {second}, both of the arm, would touch: {value} of one inside the other.",
    "self_collision_touch": "{first} and {second}, both of the arm, would touch.",
    "self_collision_unknown": "{first} and {second}, both of the arm, would be too near to one another.",
    # how fast, and along lines
    "pull_out_torque": "The motor of {subject} would have to give {value} of its force: go slower.",
    "step_rate": "{subject} would come to {value} of the steps per second that it can: go slower.",
    "pulse_width": "{subject} would come to {value} of the pulses per second of its driver: go slower.",
    "device_queue": "To brake from this speed takes {value} of the device's queue: go slower.",
    "jump": "{subject} would have to jump by {value} on that line: go farther from there, or take any path that is "
    "free.",
    "configuration": "The tool gets there, but {subject} ends at {value}, not at {limit}: take any path that is free.",
    # how sure
    "confidence": "It is only {value} sure that {subject} has lost no step, and {limit} is asked for: verify it.",
}
