"""The handler of everything that the device says, in frames and in JSON."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.schemas.device import DeviceMode
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.system import LogLevel
from gemelo.schemas.topics import DEVICE_SHAFT, DEVICE_STATE, JOINT_COMMANDS, JOINT_STATES, STEP_ERRORS
from gemelo.services.stepper_gateway.components import Components
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.device.rest_thinner import RestThinner
from gemelo.services.stepper_gateway.inputs import FrameInput
from gemelo.services.stepper_gateway.links.frames import Ack, BadFrame, CommandReply, StateFrame, SyncReply, decode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import (
    ConfigAckReport,
    EventReport,
    ShaftReport,
    StatusReport,
    decode_report,
    decode_sensors,
)
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.path_version import PathPoint

STOPPED = ("hold", "homing_stopped")
BY_LOST_HEARTBEAT = "heartbeat"  # the detail of these
LOST = (DeviceMode.FAULT, DeviceMode.ESTOP, DeviceMode.UNREFERENCED, DeviceMode.HOMING, DeviceMode.BOOT)
TROUBLE = (
    "fault", "hold", "late", "underrun", "estop", "homing_stopped", "text_lost", "inject_refused", "position_lost",
)  # fmt: skip
MOTION = {"started": "from", "finished": "at"}  # how the place of a motion's event is introduced
POSITION_LOST = "position_lost"  # the event of a board of another dialect, which begins anew by it
SHORTEST = 1.0 / (JOINT_STATES.rate or 50.0)  # [s] between two states in motion
BY_A_PERSON = "command"  # the detail of what somebody has asked for


class FrameHandler:
    """The device's side of the core."""

    def __init__(self, parts: Components) -> None:
        self._components = parts
        self._device, self._controller = parts.device, parts.controller
        self._thinner = RestThinner(SHORTEST)
        self._position_lost: Reason | None = None  # of a board of another dialect, until its next boot is met

    def take(self, received: FrameInput, moment: Moment) -> None:
        """One payload; raises `BadFrame` for one that no device says."""
        payload, arrival = received.payload, received.arrival * 1e-9
        if received.retained and received.kind != Kind.STATUS:
            raise BadFrame("it is retained, and only a status may be")
        match received.kind:
            case Kind.STATUS:
                if not payload:
                    raise BadFrame("it is empty: somebody has cleared it at the broker, which changes nothing")
                self._on_status(decode_report(StatusReport, payload), moment)
            case Kind.EVENT:
                self._on_event(decode_report(EventReport, payload), moment)
            case Kind.CONFIG_ACK:
                self._device.configuration.on_ack(decode_report(ConfigAckReport, payload))
            case Kind.SENSORS:
                readings = decode_sensors(payload)
                self._components.sensors.on_readings(readings, arrival, moment)
                self._components.gripper.on_readings(readings, arrival)
                self._components.echoes.on_readings(readings, arrival)
            case Kind.SHAFT:
                self._on_shaft(decode_report(ShaftReport, payload), arrival, moment)
            case _:
                self._on_frame(received, arrival, moment)

    def is_state_due(self, t_us: int, moment: Moment) -> bool:
        """True if a state of `t_us` [us] that repeats the one before would be published."""
        return self._thinner.is_due(t_us * 1e-6, self._longest_gap(moment))

    def _longest_gap(self, moment: Moment) -> float:
        """[s] between two published states at rest."""
        return self._device.resting.longest_gap(self._device.parameters.rest_rate, moment)

    def _on_frame(self, received: FrameInput, arrival: float, moment: Moment) -> None:
        frame = decode(received.payload)
        match received.kind, frame:
            case Kind.STATE, StateFrame():
                self._on_state(frame, arrival, moment)
            case Kind.TRAJ_ACK, Ack():
                self._device.session.require_known(frame)
                self._device.session.require_present(frame, frame.t_us, arrival)
                if frame.boot_id == self._device.session.boot_id:
                    self._controller.on_ack(frame, arrival, moment)
                    self._components.streaming.on_ack(moment)
                    self._components.goals.on_ack()
            case Kind.SYNC_R, SyncReply():
                self._device.session.on_sync_reply(frame, received.arrival // 1000)
                self._components.echoes.on_reply(frame, received.arrival // 1000)
            case Kind.CMD_ACK, CommandReply():
                self._device.session.require_present(frame, frame.t_us, arrival)
                self._device.session.on_reply(frame)
                self._components.command_handler.on_reply(frame, moment)
            case _:
                raise BadFrame(f"a {type(frame).__name__.removesuffix('Frame')} frame does not belong there")

    def _on_status(self, status: StatusReport, moment: Moment) -> None:
        device = self._device
        before = device.configuration.device_crc32
        device.session.on_status(status)
        if not status.online and status.boot_id == device.session.boot_id:
            self._components.injections.on_last_will()
        device.configuration.on_status()
        if before and device.configuration.device_crc32 != before:
            self._components.start_over(because("device.configuration.changed"), moment)
        known = device.session.status
        if known is not None and known.tick_hz:
            self._components.goals.use_tick(known.tick_hz)

    def _on_event(self, event: EventReport, moment: Moment) -> None:
        publish_event(event, self._device, moment)
        self._components.ledger.on_event(event, moment)
        if event.event in STOPPED:
            self._on_stopped(event, moment)
        elif event.event == POSITION_LOST:
            self._position_lost = event.why or plain(event.detail)
            self._components.start_over(self._position_lost, moment)
        self._components.injections.on_event(event)

    def _on_stopped(self, event: EventReport, moment: Moment) -> None:
        """The device slows down by itself; where it misses heartbeats that were sent, it gets a fresh session."""
        device = self._device
        self._controller.held = (event.stream, event.detail)
        if event.detail == BY_LOST_HEARTBEAT and device.session.renew_heartbeat(moment):
            device.event("heartbeat_renewed", because("device.heartbeat_renewed"), moment)

    def _on_shaft(self, report: ShaftReport, arrival: float, moment: Moment) -> None:
        measured = self._device.session.clock.measured(report.t_us, arrival)
        self._device.publish(DEVICE_SHAFT, self._device.reporter.shaft(report, moment.unix_at(measured)), moment)

    def _on_state(self, state: StateFrame, arrival: float, moment: Moment) -> None:
        device, controller = self._device, self._controller
        is_news, is_reboot = device.session.on_state(state, arrival, device.parameters.state_timeout)
        if is_reboot:
            lost, self._position_lost = self._position_lost, None
            if lost is None:
                device.event("rebooted", because("device.restarted.anew"), moment)
            self._components.start_over(lost or because("device.restarted"), moment)
            self._components.injections.on_reboot()
        if not is_news:
            return
        if not device.session.fits(state):
            self._abort_all(moment)
            self._publish_device(state, moment)
            self._components.command_handler.tell_shown(moment)
            return
        controller.on_state(state, arrival)
        point = controller.commanded(state)
        if self._thinner.passes((replace(state, t_us=0), point), state.t_us * 1e-6, self._longest_gap(moment)):
            self._publish(state, point, moment)
        self._components.ledger.on_state(state, point, moment)
        self._components.gripper.on_state(state, moment)
        if state.mode == DeviceMode.HOLD and controller.is_followed(state) and not controller.is_held:
            self._components.streaming.interrupt()
            self._components.goals.on_hold(moment)
        if state.mode in LOST:
            self._abort_all(moment)
        self._components.goals.on_ack()
        self._components.goals.on_state(state, point, moment)
        self._components.stop_foreign_motion(moment)
        self._components.command_handler.tell_shown(moment)

    def _abort_all(self, moment: Moment) -> None:
        """The device cannot go on, by its newest state."""
        if (reason := self._device.not_ready_reason()) is not None:
            self._components.abort_all(reason, moment)

    def _publish(self, state: StateFrame, point: PathPoint, moment: Moment) -> None:
        reporter = self._device.reporter
        stamp = self._publish_device(state, moment)
        is_open_loop = self._device.session.is_open_loop
        self._device.out.publish(JOINT_STATES, reporter.joint_state(state, stamp, is_open_loop))
        self._device.publish(JOINT_COMMANDS, reporter.joint_command(point, state, stamp), moment)
        if not is_open_loop:  # else nobody knows them
            self._device.publish(STEP_ERRORS, reporter.step_errors(point, state, stamp), moment)

    def _publish_device(self, state: StateFrame, moment: Moment) -> int:
        """The state's stamp [ns]."""
        session = self._device.session
        stamp = moment.unix_at(session.clock.measured(state.t_us, session.state_arrival))
        self._device.out.publish(
            DEVICE_STATE, self._device.reporter.device_state(state, stamp, session.clock, session.unanswered_for)
        )
        return stamp


def publish_event(event: EventReport, device: GatewayDevice, moment: Moment) -> None:
    """Say it on the bus and in the log."""
    is_trouble = event.event in TROUBLE and event.detail != BY_A_PERSON
    level = LogLevel.WARNING if is_trouble else LogLevel.INFO
    now = moment.monotonic
    happened = device.session.clock.measured(event.t_us, now) if event.t_us else now
    said = _motion(event.event, device) if event.event in MOTION else ""
    device.event(event.event, event.why or event.detail, Moment(moment.unix_at(happened), happened), level, said)


def _motion(event: str, device: GatewayDevice) -> str:
    """That a motion begins or ends, and where the joints are; empty where that is not known."""
    if device.state is None:
        return ""
    places = zip(device.joints, device.reporter.positions(device.state.steps), strict=True)
    where = ", ".join(f"{joint.name} {position:+.4f} {joint.unit}" for joint, position in places)
    return f"motion {event}: {MOTION[event]} {where}"
