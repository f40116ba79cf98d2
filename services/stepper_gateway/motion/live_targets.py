"""Streamed targets on a device that takes replacements: from the first target to the end of the stream at rest."""

from __future__ import annotations

from collections.abc import Mapping

from gemelo.schemas.joints import JointTargets
from gemelo.schemas.planning import StreamVerdict
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import LogLevel
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.chunk import ahead_of, filled
from gemelo.services.stepper_gateway.motion.live_follower import LiveFollower, Proposal, Way
from gemelo.services.stepper_gateway.motion.live_stream import LiveStream
from gemelo.services.stepper_gateway.motion.motion_controller import MotionController
from gemelo.services.stepper_gateway.motion.stream_watch import StreamWatch, obstructed


class LiveTargets:
    """At most one stream; what waits until the arm rests begins it."""

    def __init__(self, device: GatewayDevice, controller: MotionController) -> None:
        self._device, self._controller = device, controller
        self._follower: LiveFollower | None = None
        self._stream: LiveStream | None = None  # None: the targets wait until the arm rests
        self._complaint: Reason | None = None
        self._obstruction: Reason | None = None
        self._watch = StreamWatch(device)
        self._is_watched = True  # the newest targets wait for the planner's word
        self._is_settling = False  # the path that waits for it is the one to rest at the last target

    @property
    def is_followed(self) -> bool:
        """True if there is a target that leads the arm, or waits to do so."""
        return self._follower is not None

    @property
    def is_active(self) -> bool:
        """True if targets lead the arm."""
        return self._stream is not None

    def take(
        self, targets: JointTargets, columns: Mapping[int, float], moment: Moment, was_watched: bool = False
    ) -> None:
        """The newest target, whose positions [rad] or [m] are by column; joints that it does not name keep theirs, or
        stand still. `was_watched`: the planner has looked at its way already."""
        self._is_watched = self._device.parameters.watch_streams and not was_watched
        if not self._is_watched:
            self._watch.begin()  # an answer that is due no longer counts
        follower = self._follower
        if follower is None:
            base = self._controller.motion_start(moment).start.position
            follower = self._follower = LiveFollower(self._device.joints)
            self._watch.begin()
            if not was_watched and not self._is_watched:
                self._device.event("target_unwatched", because("target.by_choice"), moment, LogLevel.INFO)
            if not targets.stamp:
                self._device.event("target_unstamped", because("target.unstamped"), moment)
        else:
            base = follower.due(moment.monotonic)
        rates = dict(zip(columns, targets.velocity, strict=False))
        velocity = filled(rates, (0.0,) * len(base)) if rates else ()
        sent = moment.monotonic + (targets.stamp - moment.unix) * 1e-9 if targets.stamp else None
        ahead = ahead_of(targets, tuple(columns), base)
        follower.take(filled(columns, base), velocity, sent, moment.monotonic, ahead)
        self._watch.on_target()
        self.send_due(moment)

    def step(self, is_silent: bool, moment: Moment) -> Reason | None:
        """Send what waits, and end a stream that `is_silent`; why it has failed, None if it has not."""
        stream = self._stream
        if stream is not None and (stream is not self._controller.stream or stream.is_abandoned or stream.failure):
            self.drop()
            return stream.failure if not stream.is_abandoned else None
        if is_silent:
            self.end()
        if (unwatched := self._watch.unwatched(moment)) is not None:
            self.end()
            return unwatched
        self.send_due(moment)
        return None

    def on_verdict(self, verdict: StreamVerdict, moment: Moment) -> None:
        """The planner has looked at a path: it is sent, or a shorter way is tried."""
        proposal, follower = self._watch.answered(verdict, moment), self._follower
        if proposal is None or follower is None:
            return
        if verdict.free and self._is_in_time(proposal, moment):
            return self._commit(proposal, moment)
        if not verdict.free:
            self._obstruction = obstructed(verdict)
        if self._is_settling:
            follower.is_settled = not verdict.free
        elif verdict.free or self._watch.tries_again:
            follower.is_pending = True
            self._send(follower, moment)

    def send_due(self, moment: Moment) -> None:
        """Send a message, if there is something new to say and the device may take it."""
        follower, stream = self._follower, self._stream
        if follower is None or self._watch.is_waiting or self._device.refusal(moment):
            return
        if stream is None:
            if self._controller.is_resting() and (follower.is_pending or not self._is_watched):
                self._send(follower, moment)
            return
        if stream.is_abandoned or stream.failure:
            return
        self._complaint, stream.complaint = self._complaint or stream.complaint, None
        if stream.wants_fresh:
            stream.wants_fresh, follower.is_pending = False, True
        if stream.is_begun and follower.is_due(moment.monotonic):
            self._send(follower, moment)
        elif stream.is_begun:
            later = self._watch.way.later if self._is_watched else 0.0
            proposal = follower.settling(stream, moment, self._device.session.clock, later)
            if proposal is not None:
                self._offer(proposal, moment, is_settling=True)

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

    def take_obstruction(self) -> Reason | None:
        """What is in the way of the targets, once."""
        obstruction, self._obstruction = self._obstruction, None
        return obstruction

    def _send(self, follower: LiveFollower, moment: Moment) -> None:
        """Make the next message from the newest targets."""
        parameters, clock = self._device.parameters, self._device.session.clock
        stream = self._stream or self._controller.motion_start(moment).start
        way = self._watch.way if self._is_watched else Way()
        proposal = follower.message(stream, parameters.target_delay, parameters.catch_up, moment, clock, way)
        if proposal is not None:
            self._offer(proposal, moment)

    def _offer(self, proposal: Proposal, moment: Moment, is_settling: bool = False) -> None:
        """Send it, or have it looked at before."""
        self._is_settling = is_settling
        if self._is_watched:
            self._watch.ask(proposal, moment)
        else:
            self._commit(proposal, moment)

    def _is_in_time(self, proposal: Proposal, moment: Moment) -> bool:
        """True if the path can still go on by it."""
        stream = self._stream
        if stream is None:
            return proposal.version is None and self._controller.is_resting() and not self._device.refusal(moment)
        if stream.is_abandoned or stream.failure or stream.log.newest is not proposal.version:
            return False
        soonest = stream.splice(moment.monotonic, self._device.session.clock)
        return stream.log.newest is proposal.version and soonest.from_us <= proposal.splice.from_us

    def _commit(self, proposal: Proposal, moment: Moment) -> None:
        if self._stream is None:
            self._stream = self._controller.begin_live()
            self._stream.begin(self._device.session.clock)
        chunk = self._stream.replace(*proposal[:5])
        self._controller.replace(self._stream, chunk, moment)
