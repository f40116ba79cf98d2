"""`gemelo link ra`: this arm in place of a sketch, for a publisher that knows only `ra/juntas`."""

from __future__ import annotations

import json
import queue
import secrets

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.schemas.device import DeviceCommandRequest, DeviceEvent, DeviceStatus, OutputCommand
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_EVENTS,
    DEVICE_STATE,
    DEVICE_STATUS,
    JOINT_TARGETS,
    SENSORS,
)
from gemelo.tools.cli.common.errors import CommandError, ExitCode, reason_of
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect, share_control
from gemelo.tools.cli.device.ra_intake import OUTPUT, RaIntake, RefusedMessage
from gemelo.tools.cli.parser import Options

JOINTS, STATES, READINGS = "ra/juntas", "ra/estados", "ra/sensores"
PERIOD = 0.05  # [s] between two targets; the gateway brakes after 0.5 s without one
TELEMETRY = 0.1  # [s] as the sketch's
MOST_WAITING = 256  # messages; chosen: a publisher sends ten a second
ENDS = ("target_refused", "hold", "fault", "estop", "rebooted")  # events after which nothing is continued


def run(options: Options) -> ExitCode:
    """Until Ctrl-C."""
    with connect() as session:
        share_control(session)
        listener = Listener(session)
        try:
            listener.run()
        except KeyboardInterrupt:
            print(f"\n{sentence(because('ra.ended'))}")
        finally:
            listener.close()
    return ExitCode.OK


class Listener:
    """One publisher's arm."""

    def __init__(self, session: CommandSession) -> None:
        self._session, node = session, session.node
        self._intake = RaIntake(session.arm)
        self._state, self._status = node.latest(DEVICE_STATE), node.latest(DEVICE_STATUS)
        self._sensors = node.latest(SENSORS)
        self._targets = node.publisher(JOINT_TARGETS)
        node.subscribe(DEVICE_EVENTS, self._on_event)
        self._inbox: queue.Queue[bytes] = queue.Queue(MOST_WAITING)
        self._is_following = False
        self._telemetry = 0.0  # [s] when it is due
        self._client = self._connected()

    def run(self) -> None:
        """Follow and tell, again and again."""
        names = ", ".join(joint.wire_name for joint in self._session.arm.joints)
        _print(because("ra.begun", topic=JOINTS, robot=self._session.arm.name, names=names))
        while True:
            self._session.node.wait(PERIOD)
            while not self._inbox.empty():
                self._take(self._inbox.get())
            self._follow()
            self._tell()

    def close(self) -> None:
        """Leave the broker; without targets the gateway brakes. What it keeps of us says that nobody is here."""
        self._client.publish(STATES, b"", retain=True)
        self._client.disconnect()
        stop_loop(self._client)

    def _connected(self) -> paho.Client:
        mqtt = self._session.deployment.mqtt
        client = paho.Client(CallbackAPIVersion.VERSION2, f"gemelo-sketch-{secrets.token_hex(6)}")
        client.on_connect = lambda it, *_: it.subscribe(JOINTS, 1)
        client.on_message = self._on_message
        try:
            client.connect(mqtt.host, mqtt.port, keepalive=5)
        except OSError as error:
            raise CommandError(because("ra.no_broker", host=mqtt.host, port=mqtt.port, error=str(error))) from error
        client.loop_start()
        return client

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        # What a broker has kept was asked for at another time.
        if not message.retain and not self._inbox.full():
            self._inbox.put(bytes(message.payload))

    def _on_event(self, event: DeviceEvent) -> None:
        if event.event in ENDS and self._is_following:
            self._intake.forget()
            self._is_following = False
            _print(because("ra.stopped", event.why or plain(event.detail), event=event.event))

    def _take(self, payload: bytes) -> None:
        try:
            wanted = self._intake.take(payload, self._stands())
        except RefusedMessage as refused:
            _print(because("ra.refused", refused.reason))
            return
        if wanted.objection is not None:
            _print(because("ra.refused.switched", wanted.objection, output=OUTPUT))
        self._is_following = self._is_following or wanted.moves is not None
        if wanted.output is not None:
            self._switch(wanted.output)

    def _stands(self) -> tuple[int, ...]:
        """[steps]; raises `RefusedMessage` while the arm cannot be moved."""
        state, status = self._state.message, self._status.message
        if state is None or status is None or not status.online or status.reason:
            raise RefusedMessage(why_not_moved(status))
        if not self._is_following:
            self._intake.forget_if_elsewhere(state.steps)
        return state.steps

    def _follow(self) -> None:
        target, state = self._intake.target, self._state.message
        if not self._is_following or target is None or state is None:
            return
        if self._intake.is_reached(state.steps) and not any(state.velocity):
            self._is_following = False
            return
        names = tuple(joint.name for joint in self._session.arm.joints)
        self._targets.put(JointTargets(name=names, position=target))

    def _switch(self, on: bool) -> None:
        state = self._state.message
        if state is None or (OUTPUT in state.outputs) is on:
            return
        request = DeviceCommandRequest(command=OutputCommand(output=OUTPUT, on=on))
        try:
            answer = self._session.node.call(DEVICE_COMMAND, request)
        except (RequestRefused, NoAnswer) as error:
            _print(because("ra.refused.output", reason_of(error) or plain(str(error)), output=OUTPUT))
            return
        if not answer.accepted:
            _print(because("ra.refused.output", answer.why or plain(answer.reason), output=OUTPUT))

    def _tell(self) -> None:
        now, state = self._session.node.monotonic(), self._state.message
        if now < self._telemetry or state is None or self._state.is_stale:
            return
        self._telemetry = now + TELEMETRY
        mode = int(state.mode)
        self._client.publish(STATES, json.dumps({"estado": mode, "Estado": mode}), retain=True)
        readings = self._sensors.message
        if readings is not None and not self._sensors.is_stale:
            said = {name: round(value, 3) for name, value in zip(readings.name, readings.value, strict=True)}
            self._client.publish(READINGS, json.dumps({**said, "Estado": mode}))


def why_not_moved(status: DeviceStatus | None) -> Reason:
    """Why no message moves the arm with that status, None for one that was not received."""
    if status is None:
        return because("ra.silent")
    return status.why or plain(status.reason)


def _print(what: Reason) -> None:
    print(sentence(what), flush=True)
