"""The stopping distance at every moment: how far the tool still goes if gateway, network or broker are lost now."""

from __future__ import annotations

import math
from itertools import pairwise

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.frames.transforms import Point
from gemelo.libraries.arm.kinematics.tool_jacobian import ToolJacobian
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.ledger import StoppingDistance
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import STOPPING_DISTANCE
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.stopping import MARGIN, Segment, StoppingPath, segment, stop_on
from gemelo.services.stepper_gateway.motion.stream import Stream

PERIOD = 1.0 / (STOPPING_DISTANCE.rate or 10.0)  # [s]
SLOTS = 0.004  # [s] that the device prepares ahead, and a slot for each decision: standard, firmware/core
JITTER = 1.5  # chosen: times the longest round trip of late, that the device's last heartbeat may have taken one way
STILL = 1.0  # [steps/s] chosen: slower joints stop within a step

Ends = tuple[tuple[int, Knot], tuple[int, Knot]]  # of a segment: times [us] and knots


class StoppingWatch:
    """Pure: given the moment, says what `StoppingDistance` says."""

    def __init__(self, device: GatewayDevice, controller: MotionController) -> None:
        self._device, self._controller = device, controller
        self._jacobian = ToolJacobian(device.arm)
        self._limits = tuple(joint.acceleration for joint in device.joints)
        self._timeout = device_config(device.arm).hold_timeout_ms * 1e-3
        self._told = -1.0e9  # [s] monotonic
        self._stream_id, self._began = -1, 0.0  # and when its first knots may have come [s] monotonic
        self._segments: dict[Ends, Segment] = {}  # of the path that waits, by their knots
        self._reached: tuple[Vector, Point] = ((), (0.0, 0.0, 0.0))  # joint values of the last knot, and its place

    def step(self, moment: Moment) -> None:
        """Tell what is due."""
        period = self._device.resting.period(PERIOD, moment)
        if self._device.session.latest is not None and moment.monotonic - self._told >= period:
            self._told = moment.monotonic
            self._device.publish(STOPPING_DISTANCE, self.message(moment), moment)

    def message(self, moment: Moment) -> StoppingDistance:
        """The distance from this moment on."""
        device, state = self._device, self._device.state
        session = device.session
        if reason := device.unreachable_reason(moment):
            return _unknown(reason, moment)
        if session.is_open_loop:
            return _unknown(because("stopping.open_loop"), moment)
        if state is None:
            return _unknown(because("device.joints_unknown", device=device.arm.device.name), moment)
        longest = session.clock.longest_round_trip
        stop, reaction = self._stop(state, moment, longest)
        if stop is None:
            return _unknown(because("stopping.other_path"), moment, longest)
        return StoppingDistance(
            stamp=moment.unix,
            is_known=True,
            distance=stop.distance,
            duration=stop.duration,
            reaction=reaction if stop.duration > 0.0 else 0.0,
            round_trip=longest,
        )

    def _stop(self, state: StateFrame, moment: Moment, longest: float) -> tuple[StoppingPath | None, float]:
        """The stop, and the time [s] until it begins."""
        stream, silence = self._controller.stream, self._device.session.last_beat + JITTER * longest
        is_under_way = stream is not None and not stream.is_abandoned and not stream.is_finished
        if stream is not None and stream.id != self._stream_id:
            self._stream_id, self._began = stream.id, moment.monotonic + longest
            self._segments.clear()
        if state.mode == DeviceMode.HOMING:
            return self._of_ramps(state, max(0.0, silence + self._timeout - moment.monotonic) + SLOTS)
        if is_under_way and stream is not None and not stream.has_started:
            self._began = moment.monotonic + longest  # its first knots may still be on their way
        reaction = max(0.0, max(silence, self._began) + self._timeout - moment.monotonic) + SLOTS
        is_played = stream is not None and state.stream == stream.id and state.mode in (DeviceMode.RUN, DeviceMode.HOLD)
        if stream is not None and (is_played or is_under_way):
            return self._on_path(stream, state, moment, reaction if state.mode != DeviceMode.HOLD else SLOTS)
        if state.mode == DeviceMode.RUN or any(abs(rate) >= STILL for rate in state.velocity):
            return None, 0.0
        return StoppingPath(0.0, 0.0), 0.0

    def _on_path(
        self, stream: Stream, state: StateFrame, moment: Moment, reaction: float
    ) -> tuple[StoppingPath, float]:
        """Of the path that was sent; what of it is on its way may still arrive."""
        clock = self._device.session.clock
        played = stream.played_us(moment.monotonic, clock) - round(0.5e6 * clock.round_trip)
        knots = stream.log.upcoming(played)
        path = self._path(knots)
        if path:
            left = (knots[1][0] - max(played, knots[0][0])) / max(1, knots[1][0] - knots[0][0])
            path[0] = path[0]._replace(dt=path[0].dt * left, length=path[0].length * left,
                                       gains=tuple(gain * left for gain in path[0].gains))  # fmt: skip
        scale = state.time_scale if state.stream == stream.id else 0.0
        is_held = state.mode == DeviceMode.HOLD
        top = scale if is_held else max(scale, state.speed)
        stop = stop_on(path, self._limits, scale * scale, top, reaction, ends=stream.comes_to_rest)
        if not is_held and scale < top - 0.02:  # slower than it may be: less far, but perhaps for longer
            stop = stop._replace(duration=max(stop.duration, reaction + self._longest_braking(path)))
        reaction = min(reaction, stop.duration)
        return stop._replace(duration=stop.duration + SLOTS), reaction

    def _path(self, knots: list[tuple[int, Knot]]) -> list[Segment]:
        """Between the knots that wait; each is computed once, as a knot stays as it was sent."""
        known = self._segments
        self._segments = {ends: known.get(ends) or self._segment(*ends) for ends in pairwise(knots)}
        return list(self._segments.values())

    def _segment(self, first: tuple[int, Knot], second: tuple[int, Knot]) -> Segment:
        (start, a), (end, b) = first, second
        return segment((end - start) * 1e-6, math.dist(self._place(a), self._place(b)), a.velocity, b.velocity)

    def _place(self, knot: Knot) -> Point:
        """Of the tool; a knot ends one segment and begins the next."""
        position, place = self._reached
        if position != knot.position:
            place = self._jacobian.tool(knot.position)
            self._reached = knot.position, place
        return place

    def _longest_braking(self, path: list[Segment]) -> float:
        """[s] that any speed of the path takes to rest."""
        return max((v / a for part in path for v, a in zip(part.speeds, self._limits, strict=True)), default=0.0)

    def _of_ramps(self, state: StateFrame, reaction: float) -> tuple[StoppingPath, float]:
        """Homing has no path: every joint goes on at the speed that it has, or that it homes with, and then brakes."""
        columns = self._jacobian.columns(self._device.reporter.positions(state.steps))
        distance = duration = 0.0
        for joint, column, rate in zip(self._device.joints, columns, state.velocity, strict=True):
            homing = joint.drive.homing
            speed = max(abs(rate) / joint.steps.per_unit, homing.fast if homing is not None else 0.0)
            braking = speed / (joint.acceleration / MARGIN)
            distance += math.hypot(*column) * speed * (reaction + 0.5 * braking)
            duration = max(duration, reaction + braking)
        return StoppingPath(distance, duration), reaction


def _unknown(why: Reason, moment: Moment, round_trip: float = 0.0) -> StoppingDistance:
    """That it is not known; `round_trip` [s]."""
    return StoppingDistance(stamp=moment.unix, reason=str(why), round_trip=round_trip, why=why)
