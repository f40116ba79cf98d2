"""`state_publisher` again: every recorded joint state through its core, in the recording's own time."""

from __future__ import annotations

from gemelo.schemas.topics import FRAMES, JOINT_STATES, STATIC_FRAMES
from gemelo.services.state_publisher.core import StatePublisher
from gemelo.tools.replay.comparison import Comparison
from gemelo.tools.replay.recorded import NotReplayable, Recorded

TOPICS = (JOINT_STATES, FRAMES, STATIC_FRAMES)
UNHEARD = "joint_states without recorded frames: of a LATEST topic a reader may leave messages out"
BEFORE = "frames at the beginning, of joint_states before the recording"


def replay(recorded: Recorded, comparison: Comparison) -> None:
    """Compares `static_frames` at their own stamp, and `frames` with those of the joint state of the same stamp."""
    publisher = StatePublisher(recorded.arm())
    states = recorded.require(JOINT_STATES)
    for told in recorded.of(STATIC_FRAMES):
        was = told.message
        now = min((each.stamp for each in was.transforms), default=0)  # the only clock reading that the core is given
        if not comparison.hold(STATIC_FRAMES.key, told, was, publisher.static_frames(now)):
            return
    inputs, first = (each.message for each in states), states[0].message.stamp
    for frames in recorded.require(FRAMES):
        said = frames.message
        stamp = said.transforms[0].stamp if said.transforms else 0
        if stamp < first:
            comparison.aside[BEFORE] += 1
            continue
        state = next(inputs, None)
        while state is not None and state.stamp != stamp:
            comparison.aside[UNHEARD] += 1
            state = next(inputs, None)
        if state is None:
            raise NotReplayable(
                f"{recorded.path}: the joint state of stamp {stamp} ns is missing, of which {FRAMES.key} "
                f"{frames.sequence} was made at {frames.at:.3f} s: an input was lost; take another recording"
            )
        if not comparison.hold(FRAMES.key, frames, said, publisher.on_joint_state(state).frames):
            return
    comparison.aside[UNHEARD] += sum(1 for _ in inputs)
