"""The gateway without any wire or clock: what arrives goes in, what is to be done comes out.

Every public method takes the present `Moment` and returns outputs in order.
"""

from __future__ import annotations

from msgspec.structs import replace

from schemas.device import DeviceCommandKind, DeviceCommandRequest, DeviceMode, DeviceStatus, PressRequest
from schemas.joints import JointTargets
from schemas.motion import FollowJointTrajectoryGoal
from schemas.system import LogLevel
from schemas.topics import DEVICE_SHAFT, DEVICE_STATE, DEVICE_STATUS, JOINT_COMMANDS, JOINT_STATES, STEP_ERRORS
from services.arm.description import Arm
from services.stepper_gateway.desk import CommandDesk
from services.stepper_gateway.event_desk import pass_on
from services.stepper_gateway.goals import Goals, GoalVerdict
from services.stepper_gateway.links.frames import (
    Ack,
    BadFrame,
    CommandReply,
    Heartbeat,
    State,
    SyncReply,
    decode,
    encode,
)
from services.stepper_gateway.links.link import Kind, Received
from services.stepper_gateway.links.reports import (
    ConfigAckReport,
    EventReport,
    ShaftReport,
    StatusReport,
    decode_report,
    decode_sensors,
)
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.mover import Mover
from services.stepper_gateway.outputs import Outbox, Output
from services.stepper_gateway.parameters import GatewayParameters
from services.stepper_gateway.path_log import PathPoint
from services.stepper_gateway.presses import PressDesk
from services.stepper_gateway.sensors import SensorWatch
from services.stepper_gateway.status import status_of
from services.stepper_gateway.streaming import Streaming

BAD_FRAME_REPORT = 1.0  # [s] between two
PAUSES = (  # commands that leave goals and targets as they are
    DeviceCommandKind.HOLD,
    DeviceCommandKind.RESUME,
    DeviceCommandKind.OUTPUT,
    DeviceCommandKind.SPEED,
    DeviceCommandKind.ARM,
)
LOST = (DeviceMode.FAULT, DeviceMode.ESTOP, DeviceMode.UNREFERENCED, DeviceMode.HOMING, DeviceMode.BOOT)


class GatewayCore:
    """One arm, one device."""

    def __init__(self, arm: Arm, session_id: int, parameters: GatewayParameters | None = None) -> None:
        self._out = Outbox()
        self.mover = Mover(arm, session_id, parameters or GatewayParameters(), self._out)
        self.goals = Goals(self.mover)
        self.streaming = Streaming(self.mover)
        self.desk = CommandDesk(self.mover)
        self.sensors = SensorWatch(self.mover)
        self.presses = PressDesk(self.mover)
        self.bad_frames = 0
        self._bad_reported = -1.0e9  # [s] monotonic
        self._told: DeviceStatus | None = None
        self._stepped: float | None = None  # [s] monotonic

    def set_parameters(self, parameters: GatewayParameters) -> None:
        self.mover.parameters = parameters

    def not_ready(self, moment: Moment) -> str:
        """Why the gateway's state is not valid, empty if it is."""
        mover = self.mover
        return mover.absence(moment) or ("" if mover.state is not None else mover.hindrance())

    def on_link(self, connected: bool, reason: str, moment: Moment) -> list[Output]:
        """The wire has come or gone."""
        session = self.mover.session
        if connected != session.link_up:
            session.on_link(connected, reason)
            level = LogLevel.INFO if connected else LogLevel.WARNING
            self.mover.event("connected" if connected else "disconnected", reason, moment, level)
        session.link_reason = reason
        return self._finish(moment)

    def on_received(self, received: Received, moment: Moment) -> list[Output]:
        """One payload from the device; one that is no frame is counted, and reported now and then."""
        try:
            self._dispatch(received, moment)
        except BadFrame as error:
            self.bad_frames += 1
            if moment.monotonic - self._bad_reported >= BAD_FRAME_REPORT:
                self._bad_reported = moment.monotonic
                self.mover.event("bad_frame", f"{received.kind}: {error} ({self.bad_frames} so far)", moment)
        return self._finish(moment)

    def on_goal(
        self, goal_id: str, goal: FollowJointTrajectoryGoal, moment: Moment
    ) -> tuple[GoalVerdict, list[Output]]:
        """A goal, to be accepted or refused at once."""
        verdict = self.goals.accept(goal_id, goal, moment)
        if verdict.accepted:
            self.streaming.yield_to_goal()
        return verdict, self._finish(moment)

    def on_cancel(self, goal_id: str, moment: Moment) -> tuple[str, list[Output]]:
        """Empty if the goal is being cancelled, else why not."""
        reason = self.goals.cancel(goal_id, moment)
        self.desk.send_due(moment)
        return reason, self._finish(moment)

    def on_targets(self, targets: JointTargets, moment: Moment) -> list[Output]:
        """A streamed target."""
        self.streaming.on_targets(targets, self.goals.is_active, moment)
        return self._finish(moment)

    def on_command(self, request: DeviceCommandRequest, ticket: int, moment: Moment) -> list[Output]:
        """A person's command; its answer comes as a `CommandAnswer` with this ticket."""
        if self.desk.ask(request, ticket, self.goals.is_active, moment):
            self._give_way(request, moment)
        self.desk.send_due(moment)
        return self._finish(moment)

    def on_configure(self, ticket: int, moment: Moment) -> list[Output]:
        """A person wants the device configured; the answer comes as a `ConfigureAnswer` with this ticket."""
        mover = self.mover
        mover.configuration.ask(ticket, mover.absence(moment), moment)
        return self._finish(moment)

    def on_press(self, request: PressRequest, ticket: int, moment: Moment) -> list[Output]:
        """A press of a virtual device; its answer comes as a `PressAnswer` with this ticket."""
        self.presses.ask(request, ticket, moment)
        return self._finish(moment)

    def step(self, moment: Moment) -> list[Output]:
        """One turn of the control loop, 50 times a second; sends the heartbeat."""
        mover = self.mover
        period = moment.monotonic - self._stepped if self._stepped is not None else 0.0
        self._stepped = moment.monotonic
        for frame in mover.session.due(moment):
            self._out.send(Kind.HB if isinstance(frame, Heartbeat) else Kind.SYNC, encode(frame))
        absence = mover.absence(moment)
        if absence:
            self._lose(absence, moment)
        self.goals.step(moment, period)
        self.streaming.step(moment)
        if mover.stop_strangers(moment):
            self.goals.on_stranger(moment)
        self.desk.step(moment)
        mover.configuration.step(absence, moment)
        self.presses.step(moment)
        self.sensors.step(absence, moment)
        mover.pump(moment)
        return self._finish(moment)

    def _dispatch(self, received: Received, moment: Moment) -> None:
        payload, arrival = received.payload, received.arrival * 1e-9
        if received.retained and received.kind != Kind.STATUS:
            raise BadFrame("it is retained, and only a status may be")
        match received.kind:
            case Kind.STATUS:
                self._on_status(decode_report(StatusReport, payload), moment)
            case Kind.EVENT:
                self._on_event(decode_report(EventReport, payload), moment)
            case Kind.CONFIG_ACK:
                self.mover.configuration.on_ack(decode_report(ConfigAckReport, payload))
            case Kind.SENSORS:
                self.sensors.on_readings(decode_sensors(payload), arrival, moment)
            case Kind.SHAFT:
                self._on_shaft(decode_report(ShaftReport, payload), arrival, moment)
            case _:
                self._on_frame(received, arrival, moment)

    def _on_frame(self, received: Received, arrival: float, moment: Moment) -> None:
        frame = decode(received.payload)
        match received.kind, frame:
            case Kind.STATE, State():
                self._on_state(frame, arrival, moment)
            case Kind.TRAJ_ACK, Ack():
                if frame.boot_id == self.mover.session.boot_id:
                    self.mover.on_ack(frame, arrival, moment)
                    self.goals.on_ack()
            case Kind.SYNC_R, SyncReply():
                self.mover.session.on_sync_reply(frame, received.arrival // 1000)
            case Kind.CMD_ACK, CommandReply():
                self.desk.on_reply(frame, moment)
            case _:
                raise BadFrame(f"a {type(frame).__name__} frame does not belong there")

    def _on_status(self, status: StatusReport, moment: Moment) -> None:
        mover = self.mover
        before = mover.configuration.device_crc32
        mover.session.on_status(status)
        mover.configuration.on_status()
        if before and mover.configuration.device_crc32 != before:
            self._fail("the device has another configuration", moment)
            mover.begin_anew()
        known = mover.session.status
        if known is not None and known.tick_hz:
            self.goals.use_tick(known.tick_hz)

    def _on_event(self, event: EventReport, moment: Moment) -> None:
        pass_on(event, self.mover, moment)
        self.presses.on_event(event)

    def _on_shaft(self, report: ShaftReport, arrival: float, moment: Moment) -> None:
        clock = self.mover.session.clock
        measured = min(clock.monotonic(report.t_us), arrival) if clock.is_synchronised else arrival
        self._out.publish(DEVICE_SHAFT, self.mover.reporter.shaft(report, moment.unix_at(measured)))

    def _on_state(self, state: State, arrival: float, moment: Moment) -> None:
        mover = self.mover
        is_news, is_reboot = mover.session.on_state(state, arrival, mover.parameters.state_timeout)
        if is_reboot:
            self._reboot(moment)
        if not is_news:
            return
        if not mover.session.fits(state):
            self._fail(mover.hindrance(), moment)
            self._publish_device(state, moment)
            return
        mover.on_state(state, arrival)
        point = mover.commanded(state)
        self._publish(state, point, moment)
        if state.mode == DeviceMode.HOLD and mover.is_followed(state) and not mover.is_held:
            self.streaming.interrupt()
            self.goals.on_hold(moment)
        if state.mode in LOST:
            self._fail(mover.hindrance(), moment)
        self.goals.on_ack()
        self.goals.on_state(state, point, moment)

    def _publish(self, state: State, point: PathPoint, moment: Moment) -> None:
        reporter = self.mover.reporter
        stamp = self._publish_device(state, moment)
        self._out.publish(JOINT_STATES, reporter.joint_state(state, stamp))
        self._out.publish(JOINT_COMMANDS, reporter.joint_command(point, state, stamp))
        self._out.publish(STEP_ERRORS, reporter.step_errors(point, state, stamp))

    def _publish_device(self, state: State, moment: Moment) -> int:
        """The state's stamp [ns]."""
        session = self.mover.session
        measured = session.clock.monotonic(state.t_us) if session.clock.is_synchronised else session.state_arrival
        stamp = moment.unix_at(min(measured, moment.monotonic))
        self._out.publish(DEVICE_STATE, self.mover.reporter.device_state(state, stamp, session.clock))
        return stamp

    def _give_way(self, request: DeviceCommandRequest, moment: Moment) -> None:
        """A person's command comes before goals and targets."""
        if request.command in PAUSES:
            return
        self.streaming.interrupt()
        if self.goals.is_active:
            self.goals.stop(f"stopped by a device command ({request.command.name})", moment)
        elif request.command == DeviceCommandKind.STOP:
            self.mover.stop(moment)
        else:
            self.mover.transmission.abandon()

    def _reboot(self, moment: Moment) -> None:
        reason = "the device has restarted"
        self.mover.event("rebooted", f"{reason}: its position and boot id are read anew", moment)
        self._fail(reason, moment)
        self.desk.give_up(reason)
        self.mover.begin_anew()

    def _lose(self, reason: str, moment: Moment) -> None:
        """The device cannot be reached: whatever it does now it does by itself, and nothing of it is continued."""
        self._fail(reason, moment)
        self.desk.give_up(reason)
        self.mover.lost()

    def _fail(self, reason: str, moment: Moment) -> None:
        if self.goals.is_active:
            self.goals.abort(reason, moment)
        self.streaming.interrupt()
        self.mover.transmission.abandon()

    def _finish(self, moment: Moment) -> list[Output]:
        """Tell of the device's status where it has changed, and hand the outputs out."""
        status = status_of(self.mover, moment)
        if self._told is None or replace(status, stamp=0) != self._told:
            self._told = replace(status, stamp=0)
            self._out.publish(DEVICE_STATUS, status)
        return self._out.take()
