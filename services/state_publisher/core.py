"""The frames of the moving links from joint states; pure."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.frames.transforms import to_message
from gemelo.libraries.arm.kinematics.chain import complete, joint_transform, origin_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.joints import JointState


class Decimator:
    """Passes messages at `rate` [Hz] on average whatever rate they come at; 0 passes all.

    The next message is due one period after the last one was DUE, not after it came: 25 Hz in at a limit of 20 gives
    20 out, and not 12.5.
    """

    def __init__(self, rate: float = 0.0) -> None:
        self.rate = rate
        self._due = 0  # [ns]
        self._carry = 0.0  # [ns] what the integer periods have lost
        self._last = 0  # [ns]

    def passes(self, stamp: int) -> bool:
        """True if the message of `stamp` [ns] is to be passed on."""
        if self.rate <= 0.0:
            return True
        period = 1e9 / self.rate
        if stamp < self._last or stamp - self._due > 2.0 * period:
            self._due = stamp  # the clock jumped back, or the stream is slower or had stopped
        self._last = stamp
        if stamp < self._due:
            return False
        whole = int(period + self._carry)
        self._due, self._carry = self._due + whole, period + self._carry - whole
        return True


@dataclass(frozen=True)
class FramesUpdate:
    """The result of one joint state: moving frames, if they are due, and warnings, each once."""

    frames: FrameTransforms | None = None
    warnings: tuple[str, ...] = ()


class StatePublisher:
    """Static frames once, moving ones for every joint state, with that state's own stamp."""

    def __init__(self, arm: ArmDescription, rate: float = 0.0) -> None:
        """`rate` in [Hz] of the moving frames; 0: one for every joint state."""
        self._arm = arm
        self._moving = [j for j in arm.model.joints if j.kind is not JointKind.FIXED]
        self._origins = {joint.name: origin_of(joint) for joint in arm.model.joints}
        self._names = {joint.name for joint in self._moving}
        self._has_mimics = any(joint.mimic for joint in self._moving)
        self._said: set[str] = set()
        self.decimator = Decimator(rate)
        self.dropped: Counter[str] = Counter()  # by joint name, or what was wrong

    def static_frames(self, now: int) -> FrameTransforms:
        """The poses of all fixed links; `now` [ns] UNIX."""
        fixed = (joint for joint in self._arm.model.joints if joint.kind is JointKind.FIXED)
        return FrameTransforms(
            transforms=tuple(
                FrameTransform(
                    stamp=now, parent=joint.parent, child=joint.child, transform=to_message(self._origins[joint.name])
                )
                for joint in fixed
            )
        )

    def on_joint_state(self, state: JointState) -> FramesUpdate:
        """The frames of the joints in `state` and of those that mimic them; None where none is due or there is none."""
        if len(state.position) != len(state.name):
            return FramesUpdate(warnings=self._drop("sizes", _sizes(state)))
        warnings: tuple[str, ...] = ()
        positions: dict[str, float] = {}
        for name, position in zip(state.name, state.position, strict=True):
            if name in self._names:
                positions[name] = position
            else:
                warnings += self._drop(name, self._unknown(name))
        if not positions or not self.decimator.passes(state.stamp):
            return FramesUpdate(warnings=warnings)
        return FramesUpdate(self._frames(state.stamp, positions), warnings)

    def _frames(self, stamp: int, positions: dict[str, float]) -> FrameTransforms:
        known = complete(self._arm.model, positions) if self._has_mimics else positions
        return FrameTransforms(
            transforms=tuple(
                [
                    FrameTransform(
                        stamp=stamp,
                        parent=joint.parent,
                        child=joint.child,
                        transform=to_message(joint_transform(joint, known[joint.name], self._origins[joint.name])),
                    )
                    for joint in self._moving
                    if joint.name in known
                ]
            )
        )

    def _drop(self, kind: str, warning: str) -> tuple[str, ...]:
        """Count it; say it the first time only."""
        self.dropped[kind] += 1
        if kind in self._said:
            return ()
        self._said.add(kind)
        return (warning,)

    def _unknown(self, name: str) -> str:
        hint = suggestion(name, self._names)
        return f'joint_states: "{name}" is no moving joint of {self._arm.name}{hint}; it is dropped from now on'


def _sizes(state: JointState) -> str:
    return f"joint_states: {len(state.name)} names with {len(state.position)} positions; such messages are dropped"
