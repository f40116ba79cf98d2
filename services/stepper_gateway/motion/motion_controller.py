"""Moves the device: starts and splices motions, keeps them fed, stops them, and knows where the arm is meanwhile."""

from __future__ import annotations

from collections import deque

from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import COMMAND_ACKS, COMMANDS
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.goals.goal_validator import MotionStart
from gemelo.services.stepper_gateway.links.frames import Ack, Chunk, StateFrame, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knot_sources import KnotSource
from gemelo.services.stepper_gateway.motion.knots import Knot, whole_steps
from gemelo.services.stepper_gateway.motion.live_stream import LiveStream
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.motion.stream import SentChunk, Stream
from gemelo.services.stepper_gateway.motion.transmission import MotionTransmission

HISTORY = 1.0  # [s] of measured positions: a trajectory may have been planned from any of them
EXPIRED = 1.5  # [s] after which the device takes nothing that was sent before; chosen: its time to live, and half
STANDING = 0.5  # [s] without a step, after which an arm stands and does not only turn back; chosen: 25 states
STOP_AGAIN = 0.5  # [s] between STOPs for a device that does not obey; chosen: braking may take as long
MOVING = (DeviceMode.RUN, DeviceMode.HOLD)


class Slowdown:
    """1 - time scale, as far as a hold or SPEED accounts for it; a starving queue is not excused."""

    def __init__(self) -> None:
        self.share = 0.0  # of the time that passes, by which a goal may end later

    def on_state(self, state: StateFrame, is_held: bool) -> None:
        """Take the time scale of a state; `is_held`: by a person's command."""
        slowness = 1.0 - state.time_scale
        if is_held:
            self.share = slowness
        elif state.mode != DeviceMode.RUN:
            self.share = 0.0
        else:
            # After a hold or a low speed it takes a while to be fast again, and is never slower than before.
            self.share = min(slowness, max(1.0 - state.speed, self.share))


class MotionController:
    """What goals and streamed targets have in common."""

    def __init__(self, device: GatewayDevice, first_stream: int) -> None:
        self._device = device
        self.transmission = MotionTransmission(device.joints, first_stream)
        self._slowness = Slowdown()
        self.lead = device.parameters.trajectory_lead  # [s]
        self._holds = False  # by a person's command, who will resume
        self._held_us = 0  # device time of its answer to HOLD
        self._history: deque[tuple[float, Vector]] = deque()
        self._stop_asked = -1.0e9  # [s] monotonic
        self._stopped_us = -1  # device time of its answer to the latest STOP
        self._awaits_stop = False
        self._unheard_since = -1.0e9  # [s] monotonic: the first STOP of those that nobody has answered
        self._moved = -1.0e9  # [s] monotonic: of the newest state with other steps than the one before
        self._is_silenced = False  # the latest STOP is ours, because targets fell silent
        self.held = (0, "")  # the stream that the device has held last, and why, in its own words

    @property
    def stream(self) -> Stream | None:
        return self.transmission.stream

    @property
    def is_followable(self) -> bool:
        """True if the device may have something of ours to play."""
        return self.stream is not None and not (self.stream.is_abandoned or self.stream.is_finished)

    @property
    def is_held(self) -> bool:
        """True if a person has asked for a hold, and has not ended it."""
        return self._holds or self._device.commands.is_pending(DeviceCommandKind.HOLD)

    def is_followed(self, state: StateFrame) -> bool:
        """True if the device plays the stream that we want it to play."""
        return self.transmission.owns_motion and self.stream is not None and state.stream == self.stream.id

    def is_resting(self) -> bool:
        """True if the device stands idle with nothing under way to it."""
        if self._device.session.mode != DeviceMode.IDLE or (self._awaits_stop and not self.has_stopped()):
            return False
        stream = self.stream
        return stream is None or stream.is_abandoned or stream.is_finished

    def is_still(self) -> bool:
        """True if nothing of ours is under way to the device, in whatever mode it stands, and the last STOP is done."""
        return not self.is_followable and (not self._awaits_stop or self.has_stopped())

    def comes_to_rest(self) -> bool:
        """True if the device decelerates because streamed targets fell silent, and a new motion may wait for its rest.

        Not after a person's STOP: what was asked for before it must not move the arm behind it.
        """
        is_stopping = self._awaits_stop and not self.has_stopped()
        return self._is_silenced and is_stopping and self._device.session.mode in MOVING and not self.is_held

    @property
    def slowdown_share(self) -> float:
        """Share of the time, 0 to 1, by which a goal may end later, because a person wants the arm slow."""
        return self._slowness.share

    def begin(self, motion: KnotSource, position: Vector, moment: Moment) -> Stream:
        """A new stream from rest at `position` [rad] or [m]; its first chunk leaves at once."""
        self._begins()
        boot_id, capacity = self._device.session.boot_id, self._device.queue_capacity
        stream = self.transmission.begin(motion, Knot.at_rest(position), boot_id, capacity)
        self.pump(moment)
        return stream

    def begin_live(self) -> LiveStream:
        """A new stream from rest whose chunks replace one another; `replace` sends them."""
        self._begins()
        return self.transmission.begin_live(self._device.session.boot_id, self._device.queue_capacity)

    def replace(self, stream: LiveStream, chunk: SentChunk, moment: Moment) -> None:
        """Send one chunk of a live stream."""
        self._send([(stream.frame(chunk, moment, self._device.session.clock), chunk)], moment)

    def _begins(self) -> None:
        self._device.reporter.motion_begins()
        self._stopped_us, self._awaits_stop = -1, False

    def pump(self, moment: Moment) -> None:
        """Send what is due of the present stream."""
        if self._device.session.is_fresh(moment, self._device.parameters.state_timeout):
            self._send(self.transmission.pump(moment, self._device.session.clock, self.lead), moment)

    def on_ack(self, ack: Ack, arrival: float, moment: Moment) -> None:
        """Account for a chunk's answer of `arrival` [s], and fill a gap that it tells of."""
        stream, round_trip = self.stream, 0.0
        if stream is not None and ack.stream == stream.id and ack.boot_id == stream.boot_id:
            round_trip, lost = stream.on_ack(ack, arrival)
            self._send(self.transmission.again(lost, moment, self._device.session.clock), moment)
        device = self._device
        # A board of another dialect answers no chunk: its stand-in in this process does.
        round_trip = 0.0 if device.session.is_open_loop else round_trip
        steps = device.state.steps if device.state is not None else ()
        device.out.publish(COMMAND_ACKS, device.reporter.ack(ack, round_trip, moment.unix_at(arrival), steps))

    def on_state(self, state: StateFrame, arrival: float) -> None:
        """Account for what the device says of the stream at `arrival` [s]."""
        stream = self.stream
        if stream is not None and state.stream == stream.id:
            stream.on_state(state)
        positions = self._device.reporter.positions(state.steps)
        if not self._history or self._history[-1][1] != positions:
            self._moved = arrival
        self._history.append((arrival, positions))
        while self._history[0][0] < arrival - HISTORY:
            self._history.popleft()
        if state.mode not in MOVING or (state.mode == DeviceMode.RUN and state.t_us > self._held_us):
            self._holds = False
        self._slowness.on_state(state, self.is_held)

    def commanded(self, state: StateFrame) -> PathPoint:
        """The path [steps] at the instant of `state`; where it is, if it follows no path of ours."""
        stream = self.stream
        if stream is None or state.stream != stream.id:
            return PathPoint(tuple(float(count) for count in state.steps), (0.0,) * len(state.steps))
        return stream.commanded(state)

    def rest_position(self) -> Vector:
        """[rad] or [m] where the arm rests: the path's own end if the device stands on it, else its step counts."""
        state, stream = self._device.state, self.stream
        if state is None:
            return self._device.arm.reference_position
        if stream is None or not stream.is_finished or state.stream != stream.id:
            return self._device.reporter.positions(state.steps)
        path_end = tuple(whole_steps(q8) for q8 in stream.log.last_steps.position)
        return stream.log.last.position if path_end == state.steps else self._device.reporter.positions(state.steps)

    def motion_start(self, moment: Moment) -> MotionStart:
        """From where a new motion would start, and the range that the arm sweeps until then."""
        stream = self.stream
        if self.is_resting() or stream is None:
            return MotionStart.at_rest(self.rest_position())
        if self.comes_to_rest():
            return self._swept(Knot.at_rest(self.rest_position()), [])
        last = stream.log.last
        start = last if self.transmission.is_open else Knot.at_rest(last.position)
        ahead = stream.log.knots_between(stream.played_us(moment.monotonic, self._device.session.clock), stream.end_us)
        return self._swept(start, ahead)

    def _swept(self, start: Knot, ahead: list[Knot]) -> MotionStart:
        """From `start`, having been where the arm was lately, and going through the knots `ahead`."""
        rows = [position for _, position in self._history] + [knot.position for knot in ahead]
        columns = list(zip(*rows, strict=True))
        return MotionStart(start, tuple(map(min, columns)), tuple(map(max, columns)), self.transmission.is_open)

    def stop(self, moment: Moment, is_silence: bool = False) -> None:
        """Decelerate along the path and forget the rest of it; `is_silence`: because streamed targets fell silent."""
        stream = self.stream.id if self.stream is not None else 0
        self.transmission.abandon()
        self._holds, self._is_silenced = False, is_silence
        if not self._awaits_stop or self._stopped_us >= 0:
            self._unheard_since = moment.monotonic
        self._stop_asked, self._stopped_us, self._awaits_stop = moment.monotonic, -1, True
        timeout = self._device.parameters.command_timeout
        self._device.commands.ask(DeviceCommandKind.STOP, moment, timeout, stream=stream)

    def has_stopped(self) -> bool:
        """True if the device has answered the latest STOP and has said since that it stands."""
        state = self._device.session.latest
        return state is not None and 0 <= self._stopped_us < state.t_us and state.mode not in MOVING

    def is_unheard(self, moment: Moment) -> bool:
        """True if nobody answers the latest STOP, and it is needless by now: all that was sent before it has expired,
        and the device says that it stands."""
        state = self._device.session.latest
        if state is None or not self._awaits_stop or self._stopped_us >= 0:
            return False
        is_fresh = self._device.session.is_fresh(moment, self._device.parameters.state_timeout)
        stands = not any(state.velocity) and moment.monotonic - self._moved > STANDING
        return is_fresh and stands and moment.monotonic - self._unheard_since > EXPIRED

    def lost(self) -> None:
        """The device cannot be reached: no answer to a STOP will come, nor will a person's RESUME."""
        self._holds = self._awaits_stop = False

    def leave_stop(self, moment: Moment) -> None:
        """Ask for a STOP once more: a device that is only frozen reads it behind the knots that wait there too."""
        self._device.commands.ask(DeviceCommandKind.STOP, moment, self._device.parameters.command_timeout)

    def start_over(self) -> None:
        """Another boot, or the same one with another configuration: neither the stream nor any STOP concerns it."""
        self.transmission.forget()
        self._history.clear()
        self._stopped_us, self._stop_asked, self._awaits_stop = -1, -1.0e9, False

    def stop_answered(self, t_us: int) -> None:
        self._stopped_us = t_us

    def hold_answered(self, holds: bool, t_us: int) -> None:
        """The device has told, or shown, whether it holds because a person wants it."""
        self._holds, self._held_us = holds, t_us

    def stop_foreign_motion(self, moment: Moment) -> bool:
        """Stop a motion that is not ours, of a gateway before us or given up without a link; true if there is one."""
        state = self._device.session.latest
        if state is None or state.mode not in MOVING or self.is_held or self.is_followed(state):
            return False
        is_obeying = state.mode == DeviceMode.HOLD and self._stopped_us >= 0
        if is_obeying or self._device.unreachable_reason(moment):
            return False
        if moment.monotonic - self._stop_asked < STOP_AGAIN:
            return False
        self._device.event("stopping", because("device.foreign_stream", stream=state.stream), moment)
        self.stop(moment)
        return True

    def _send(self, chunks: list[tuple[Chunk, SentChunk]], moment: Moment) -> None:
        for frame, sent in chunks:
            self._device.out.send(Kind.TRAJ, encode(frame))
            self._device.out.publish(COMMANDS, self._device.reporter.chunk(frame, sent, moment))
