"""Streamed poses on the bus: joint targets at each arrival, and ten words a second about what limits them."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.control import ControlState
from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import JogStatus, PoseTarget
from gemelo.schemas.reasons import Reason
from gemelo.schemas.topics import CONTROL, JOG_STATUS, JOINT_TARGETS, POSE_TARGETS
from gemelo.services.planner.jog.jog_command import JogRefused, objection, standing_position
from gemelo.services.planner.jog.jog_limits import worded
from gemelo.services.planner.jog.pose_stream import BadPose, PoseStream

STATUS_PERIOD = 0.1  # [s] chosen: as of a jog
ENDS = 0.3  # [s] without a target, after which nobody leads the arm by poses; chosen: beyond a late one


class PoseService:
    """Leads the arm in the node's thread of logic; made with the first pose, so that an arm without them pays nothing.

    The gateway decides whose targets move the arm, and what ends a stream.
    """

    def __init__(self, node: Node, arm: ArmDescription, states: Latest[JointState]) -> None:
        self._node, self._arm, self._states = node, arm, states
        self._targets, self._status = node.publisher(JOINT_TARGETS), node.publisher(JOG_STATUS)
        self._control: Latest[ControlState] = node.latest(CONTROL)
        self._stream: PoseStream | None = None
        self._published = self._taken = -1.0e9  # [s] monotonic, of the newest status and the newest target
        self._client = ""
        self._is_ticking = False
        node.subscribe_signed(POSE_TARGETS, self._on_pose)

    def _on_pose(self, pose: PoseTarget, writer: str) -> None:
        control, now = self._control.message, self._node.monotonic()
        if (reason := objection(control, writer)) is not None:
            return self._refuse(reason, writer, "control", now)
        stream = self._stream = self._stream or PoseStream(Kinematics(self._arm))
        try:
            present = self._present() if stream.begins(now) else ()
            posed = stream.take(pose, present, now)
        except (BadPose, JogRefused) as wrong:
            return self._refuse(wrong.reason, writer, "pose", now)
        self._taken, self._client = now, writer if control is not None and control.held else ""
        stamp = pose.stamp or self._node.now()
        names = self._arm.joint_names
        self._targets.put(JointTargets(stamp=stamp, name=names, position=posed.position, client=writer, to_watch=True))
        if now - self._published >= STATUS_PERIOD:
            limits = tuple(worded(limit) for limit in posed.limits)
            said = "; ".join(limit.message for limit in limits)
            status = JogStatus(active=True, scale=posed.scale, limited_by=said, limits=limits)
            self._publish(status, self._client, now)
        if not self._is_ticking:
            self._is_ticking = True
            self._node.every(STATUS_PERIOD, self._tick)

    def _present(self) -> Vector:
        """Where the arm is, also while it comes to rest: the gateway begins a stream only behind that."""
        state = self._states.message
        at_rest = None if state is None else replace(state, velocity=())
        return standing_position(self._arm, at_rest, self._states.age())

    def _tick(self) -> None:
        now = self._node.monotonic()
        if now - self._taken > ENDS:
            self._publish(JogStatus(), self._client, now)
            self._is_ticking = False
            self._node.forget(self._tick)

    def _refuse(self, why: Reason, writer: str, check: str, now: float) -> None:
        if now - self._published >= STATUS_PERIOD:
            self._publish(JogStatus(scale=0.0, limited_by=str(why), check=check, why=why), writer, now)

    def _publish(self, status: JogStatus, client: str, now: float) -> None:
        self._published = now
        self._status.put(replace(status, stamp=self._node.now(), client=client))
