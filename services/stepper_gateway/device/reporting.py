"""Device states as messages of the bus: what the joints did, what was asked, and the difference."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.device import CommandAck, CommandChunk, DeviceMode, DeviceState, ShaftPositions
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.message import Vector
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.device.readiness import input_names, joint_name
from gemelo.services.stepper_gateway.links.frames import (
    Ack,
    BadFrame,
    Chunk,
    Code,
    StateFlag,
    StateFrame,
    code_name,
)
from gemelo.services.stepper_gateway.links.reports import ShaftReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.motion.stream import SentChunk

HALF_STEP = 0.5 + 1.0 / 256.0  # [steps] of whole steps beside the path: their rounding, and the path's own to 1/256


class Reporter:
    """Converts for one arm; steps stay behind this edge."""

    def __init__(self, arm: ArmDescription) -> None:
        joints = arm.joints
        self._arm = arm
        self._joints = joints
        self._names = tuple(joint.name for joint in joints)
        self._max_error = [0.0] * len(joints)
        self._converted: tuple[tuple[int, ...] | tuple[float, ...], Vector] = ((), ())  # the last steps, and where

    def motion_begins(self) -> None:
        """From here on `max_error` counts anew."""
        self._max_error = [0.0] * len(self._joints)

    def positions(self, steps: tuple[int, ...] | tuple[float, ...]) -> Vector:
        """[rad] or [m] of motor steps; a joint on its limit is there, not half a step beyond it."""
        known, positions = self._converted
        if steps is not known:
            positions = tuple([_position(joint, count) for joint, count in zip(self._joints, steps, strict=True)])
            self._converted = steps, positions
        return positions

    def _rates(self, rates: tuple[float, ...], scale: float = 1.0) -> Vector:
        return tuple([rate * scale / joint.steps.per_unit for joint, rate in zip(self._joints, rates, strict=True)])

    def joint_state(self, state: StateFrame, stamp: int, is_open_loop: bool = False) -> JointState:
        """The measured joints; in open loop what was sent, and marked as that."""
        return JointState(
            stamp=stamp,
            name=self._names,
            position=self.positions(state.steps),
            velocity=self._rates(state.velocity),
            commanded=is_open_loop,
        )

    def joint_command(self, point: PathPoint, state: StateFrame, stamp: int) -> JointState:
        """Positions [rad] or [m] and velocities [rad/s] or [m/s] that the path asks for at the same instant."""
        return JointState(
            stamp=stamp,
            name=self._names,
            position=self.positions(point.steps),
            velocity=self._rates(point.rate, state.time_scale),
        )

    def step_errors(self, point: PathPoint, state: StateFrame, stamp: int) -> StepErrors:
        """Commanded minus executed [steps]."""
        error = tuple([wanted - done for wanted, done in zip(point.steps, state.steps, strict=True)])
        self._max_error = [max(a, abs(b)) for a, b in zip(self._max_error, error, strict=True)]
        return StepErrors(
            stamp=stamp,
            name=self._names,
            commanded=point.steps,
            executed=state.steps,
            error=error,
            max_error=tuple(self._max_error),
        )

    def device_state(self, state: StateFrame, stamp: int, clock: ClockSync, age: float) -> DeviceState:
        """Everything else that the device said; its clock was asked for last `age` [s] ago."""
        return DeviceState(
            stamp=stamp,
            device_time=state.t_us,
            boot_id=state.boot_id,
            mode=DeviceMode(state.mode),
            fault=state.fault,
            fault_joint=joint_name(self._arm, state.fault_joint),
            armed=bool(state.flags & StateFlag.ARMED),
            referenced=tuple([bool(state.referenced >> index & 1) for index in range(len(state.steps))]),
            inputs=input_names(self._arm, state),
            outputs=tuple([one.name for index, one in enumerate(self._arm.outputs) if state.outputs >> index & 1]),
            speed=state.speed,
            name=self._names if len(state.steps) == len(self._names) else (),
            steps=state.steps,
            velocity=state.velocity,
            time_scale=state.time_scale,
            buffered=state.buffered_ms * 1e-3,
            stream=state.stream,
            next_seq=state.next_seq,
            play_time=state.play_us * 1e-6,
            underruns=state.underruns,
            refused=state.refused,
            bad_frames=state.bad_frames,
            round_trip=clock.round_trip,
            round_trip_age=age,
            is_round_trip_of_wire=self._answers_over_its_wire(state),
        )

    def _answers_over_its_wire(self, state: StateFrame) -> bool:
        """True if the board itself answers the questions for its clock: one that reads lines, with lines."""
        dialect = self._arm.device.dialect
        is_referenced = bool(state.referenced) and state.mode != DeviceMode.UNREFERENCED
        return dialect is Dialect.GEMELO or (dialect is Dialect.TEXT and is_referenced)

    def shaft(self, report: ShaftReport, stamp: int) -> ShaftPositions:
        """A virtual device's true shafts; raises `BadFrame` for one of another arm."""
        if len(report.steps) != len(self._joints) or len(report.shaft) != len(self._joints):
            raise BadFrame(f"shafts of {len(report.shaft)} joints, this arm has {len(self._joints)}")
        return ShaftPositions(
            stamp=stamp,
            name=self._names,
            steps=report.steps,
            shaft=report.shaft,
            position=self.positions(report.shaft),
        )

    def chunk(self, frame: Chunk, sent: SentChunk, moment: Moment) -> CommandChunk:
        """A chunk as it was sent."""
        return CommandChunk(
            stamp=moment.unix,
            stream=frame.stream,
            seq=frame.seq,
            name=self._names,
            dt=frame.dt_us * 1e-6,
            time=sent.time_us * 1e-6,
            position=tuple([knot.position for knot in sent.knots]),
            velocity=tuple([knot.velocity for knot in sent.knots]),
            acceleration=tuple([knot.acceleration for knot in sent.knots]),
            steps=frame.positions,
            step_rate=frame.velocities,
            replaces=frame.replace is not None,
            tail=0 if frame.replace is None else frame.replace.tail,
            tail_dt=0.0 if frame.replace is None else frame.replace.tail_dt_us * 1e-6,
        )

    def ack(self, ack: Ack, round_trip: float, stamp: int, steps: tuple[int, ...]) -> CommandAck:
        """The device's answer to a chunk, `round_trip` [s] after it was sent; `stamp` [ns] UNIX, `steps` executed."""
        return CommandAck(
            stamp=stamp,
            stream=ack.stream,
            seq=ack.seq,
            code=ack.code,
            reason="" if ack.code == Code.OK else code_name(ack.code),
            next_seq=ack.next_seq,
            credits=ack.credits,
            buffered=ack.buffered_ms * 1e-3,
            round_trip=round_trip,
            steps=steps,
        )


def _position(joint: Joint, count: float) -> float:
    """The device stands on the whole step nearest to a limit: a plan from there must not begin outside."""
    position = joint.steps.to_position(count)
    if joint.lower <= position <= joint.upper:
        return position
    nearest = min(max(position, joint.lower), joint.upper)
    return nearest if abs(position - nearest) * joint.steps.per_unit <= HALF_STEP else position
