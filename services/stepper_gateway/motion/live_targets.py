"""Streamed targets on a device that takes replacements: from the first target to the end of the stream at rest."""

from __future__ import annotations

from collections.abc import Mapping

from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.chunk import ahead_of, filled
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.live_follower import LiveFollower
from gemelo.services.stepper_gateway.motion.live_stream import LiveStream
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController


class LiveTargets:
    """At most one stream; what waits until the arm rests begins it."""

    def __init__(self, device: GatewayDevice, controller: MotionController) -> None:
        self._device, self._controller = device, controller
        self._follower: LiveFollower | None = None
        self._stream: LiveStream | None = None  # None: the targets wait until the arm rests
        self._complaint: Reason | None = None

    @property
    def is_followed(self) -> bool:
        """True if there is a target that leads the arm, or waits to do so."""
        return self._follower is not None

    @property
    def is_active(self) -> bool:
        """True if targets lead the arm."""
        return self._stream is not None

    def take(self, targets: JointTargets, columns: Mapping[int, float], moment: Moment) -> None:
        """The newest target, whose positions [rad] or [m] are by column; joints that it does not name keep theirs, or
        stand still."""
        follower = self._follower
        if follower is None:
            base = self._controller.motion_start(moment).start.position
            follower = self._follower = LiveFollower(self._device.joints)
            if not targets.stamp:
                self._device.event("target_unstamped", because("target.unstamped"), moment)
        else:
            base = follower.due(moment.monotonic)
        rates = dict(zip(columns, targets.velocity, strict=False))
        velocity = filled(rates, (0.0,) * len(base)) if rates else ()
        sent = moment.monotonic + (targets.stamp - moment.unix) * 1e-9 if targets.stamp else None
        ahead = ahead_of(targets, tuple(columns), base)
        follower.take(filled(columns, base), velocity, sent, moment.monotonic, ahead)
        self.send_due(moment)

    def step(self, is_silent: bool, moment: Moment) -> Reason | None:
        """Send what waits, and end a stream that `is_silent`; why it has failed, None if it has not."""
        stream = self._stream
        if stream is not None and (stream is not self._controller.stream or stream.is_abandoned or stream.failure):
            self.drop()
            return stream.failure if not stream.is_abandoned else None
        if is_silent:
            self.end()
        self.send_due(moment)
        return None

    def send_due(self, moment: Moment) -> None:
        """Send a message, if there is something new to say and the device may take it."""
        follower, stream = self._follower, self._stream
        if follower is None or self._device.refusal(moment):
            return
        if stream is None:
            if self._controller.is_resting():
                start = self._controller.motion_start(moment).start
                self._stream = self._controller.begin_live()
                self._send(follower, self._stream, start, moment)
            return
        if stream.is_abandoned or stream.failure:
            return
        self._complaint, stream.complaint = self._complaint or stream.complaint, None
        if stream.wants_fresh:
            stream.wants_fresh, follower.is_pending = False, True
        if stream.is_begun and follower.is_due(moment.monotonic):
            self._send(follower, stream, None, moment)
        elif stream.is_begun:
            chunk = follower.settling(stream, moment, self._device.session.clock)
            if chunk is not None:
                self._controller.replace(stream, chunk, moment)

    def end(self) -> None:
        """No more targets: the stream ends where its newest path comes to rest."""
        if self._stream is not None:
            self._stream.end()
        self.drop()

    def drop(self) -> None:
        """Forget the targets; the stream is stopped, or ends by itself."""
        self._follower = self._stream = None

    def take_complaint(self) -> Reason | None:
        """Why the device has refused a message, once."""
        complaint, self._complaint = self._complaint, None
        return complaint

    def _send(self, follower: LiveFollower, stream: LiveStream, start: Knot | None, moment: Moment) -> None:
        parameters, clock = self._device.parameters, self._device.session.clock
        delay, catch_up = parameters.target_delay, parameters.catch_up
        chunk = follower.message(stream, start, delay, catch_up, moment, clock)
        if chunk is not None:
            self._controller.replace(stream, chunk, moment)
