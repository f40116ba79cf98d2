"""Rubbish on every key of the bus and every MQTT topic of a running stack: refused, counted, nothing moves or dies."""

from __future__ import annotations

import math
import random

import msgspec
import paho.mqtt.client as paho
import pytest

from gemelo.libraries.runtime.actions.keys import (
    cancel_request,
    feedback_topic,
    goal_request,
    result_request,
    status_topic,
)
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.errors import GoalRefused
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.message import encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest
from gemelo.schemas.system import Failure, NodeStatistics
from gemelo.schemas.topics import (
    ACTIONS,
    DEVICE_STATUS,
    JOINT_STATES,
    LOG,
    PLAN,
    REQUESTS,
    STATISTICS,
    TOPICS,
    Delivery,
)
from gemelo.services.stepper_gateway.links.frames import Chunk, ChunkFlag, CommandFrame, Heartbeat
from gemelo.services.stepper_gateway.links.frames import encode as to_frame
from tests.schemas.samples import sample
from tests.schemas.strays import strays_for
from tests.stack.person import Operator

MEGABYTE = 1024 * 1024
LONG_AGO = 1  # [us] device time at which a stale command ended


def poisoned(message):
    """The message's payload with its first float, wherever it stands, made NaN; None where it has no float."""
    found = []

    def poison(value):
        if isinstance(value, float) and not found:
            found.append(value)
            return math.nan
        if isinstance(value, list):
            return [poison(each) for each in value]
        if isinstance(value, dict):
            return {key: poison(each) for key, each in value.items()}
        return value

    rotten = msgspec.msgpack.encode(poison(msgspec.msgpack.decode(encode(message))))
    return rotten if found else None


def rubbish_for(kind):
    """(schema, payload) pairs none of which is a `kind`."""
    name = kind.__name__
    noise = random.Random(name).randbytes(300)
    yield from [(name, noise), (name, b""), (name, bytes(MEGABYTE)), (name, b"\x91" * 5000), ("", noise)]
    yield ("Nonsense", msgspec.msgpack.encode({"stamp": 1}))
    yield (name, msgspec.msgpack.encode([1, 2, 3]))
    yield (name, msgspec.msgpack.encode({field: {} for field in kind.__struct_fields__} or 7))
    rotten = poisoned(sample(kind))
    if rotten is not None:
        yield (name, rotten)


@pytest.fixture
def stranger(stack, operator):
    """A participant of the bus that keeps to no rule."""
    bus = ZenohBus(RouterSection(port=int(stack.deployment["GEMELO_ROUTER_PORT"])), operator.arm.name)
    yield bus
    bus.close()


NEARBY = 0.02  # [rad] or [m] of the first joint: a move of some tenths of a second
KEYS = [*TOPICS, *(make(action) for action in ACTIONS for make in (feedback_topic, status_topic))]


class Neighbour(Operator):
    """A person who moves the arm a little after every stray, and reads how many were dropped."""

    def __init__(self, stack):
        super().__init__(stack, "neighbour")
        self.stranger = ZenohBus(RouterSection(port=int(stack.deployment["GEMELO_ROUTER_PORT"])), self.arm.name)
        self.bad: dict[tuple[str, str], int] = {}  # by node and key
        self._toward = NEARBY
        self.objection = ""  # why the last move did not succeed
        self.node.subscribe(STATISTICS, self._count)

    def close(self):
        self.stranger.close()
        super().close()

    def _count(self, report: NodeStatistics):
        if report.node in self.stack.processes:
            self.bad |= {(report.node, topic.key): topic.bad for topic in report.topics}

    def readers(self, key):
        """How many messages of a key each of its readers has dropped as bad, by node."""
        return {node: count for (node, read), count in self.bad.items() if read == key}

    def has_dropped(self, key, before, count):
        """Whether every reader of a key has dropped `count` messages since `before`."""
        now = self.readers(key)
        return all(now[node] - bad >= count for node, bad in before.items())

    def put_strays(self, topic):
        """How many there were."""
        publications = {}
        strays = list(strays_for(topic.message))
        for schema, payload in strays:
            if schema not in publications:
                publications[schema] = self.stranger.publish(topic.key, schema, topic.delivery, "stranger")
            publications[schema].put(payload)
            self.node.wait(0.002)  # LATEST keeps one message only
        for publication in publications.values():
            publication.close()
        return len(strays)

    def moves_a_little(self):
        """Whether a plan and its execution succeed now; why not is kept in `objection`."""
        self._toward = -self._toward
        self.seen.clear()
        assert self.wait_for(lambda: self.seen, 60.0)
        here = self.seen[-1].position
        target = JointGoal(name=self.arm.joint_names, position=(here[0] + self._toward, *here[1:]))
        plan = self.node.call(PLAN, PlanRequest(goal=target), timeout=60.0)
        if plan.code is not PlanCode.SUCCESS:
            self.objection = plan.refusal
            return False
        try:
            outcome = self.send(plan).wait(plan.duration + 5.0)
        except GoalRefused as refused:
            self.objection = str(refused.reason)
            return False
        self.objection = outcome.result.error_string
        return outcome.status is GoalStatusCode.SUCCEEDED


@pytest.fixture
def wire(stack):
    """A participant of the broker that keeps to no rule."""
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.connect("127.0.0.1", int(stack.deployment["GEMELO_MQTT_PORT"]))
    client.loop_start()
    yield client
    client.loop_stop()
    client.disconnect()


@pytest.fixture
def nothing_moves_and_nothing_dies(stack, operator):
    """Compares positions and processes before and after, and moves the arm once at the end."""
    pids = stack.pids()
    operator.seen.clear()
    assert operator.wait_for(lambda: operator.seen, 60.0)
    before = operator.seen[-1].position
    yield
    operator.wait_for(lambda: False, 0.5)
    stack.wait_ready(120.0)
    operator.seen.clear()
    assert operator.wait_for(lambda: operator.seen, 60.0)
    assert operator.seen[-1].position == before
    assert stack.pids() == pids
    outcome, _ = operator.move_again()
    assert outcome.result.executed_steps == outcome.result.commanded_steps
    for name in stack.processes:
        assert "Traceback" not in stack.logs(name), f"{name}: {stack.logs(name)[-2000:]}"


@pytest.mark.usefixtures("nothing_moves_and_nothing_dies")
def test_rubbish_on_every_topic_is_dropped_counted_and_named(stranger, operator):
    statistics: dict[tuple[str, str], int] = {}
    told: list[str] = []

    def count(report: NodeStatistics):
        for topic in report.topics:
            statistics[report.node, topic.key] = topic.bad

    operator.node.subscribe(STATISTICS, count)
    operator.node.subscribe(LOG, lambda record: told.append(record.text))
    operator.wait_for(lambda: False, 0.3)
    for topic in TOPICS:
        for schema, payload in rubbish_for(topic.message):
            publication = stranger.publish(topic.key, schema, topic.delivery, "stranger")
            publication.put(payload)
            operator.node.wait(0.01)  # LATEST keeps one message only
            publication.close()
    heard = {(node, key) for node, key in statistics if key == JOINT_STATES.key}
    assert len(heard) >= 4, heard
    assert operator.wait_for(lambda: all(statistics[node_key] > 0 for node_key in heard), 60.0), statistics
    assert statistics["stepper_gateway", "joint_targets"] >= 5
    recorded = {topic.key for topic in TOPICS if topic.recorded}
    assert operator.wait_for(lambda: recorded <= {key for (node, key), bad in statistics.items() if bad}, 60.0)
    assert any("joint_targets" in text for text in told)


@pytest.mark.usefixtures("nothing_moves_and_nothing_dies")
def test_rubbish_for_every_request_is_answered_with_a_reason(stranger, operator):
    asked = [*REQUESTS]
    for action in ACTIONS:
        asked += [goal_request(action), cancel_request(action), result_request(action)]
    for request in asked:
        for schema, payload in rubbish_for(request.request):
            answers = []
            stranger.ask(request.key, schema, payload, 3.0, answers.append)
            assert operator.wait_for(lambda answers=answers: answers, 60.0), request.key
            assert answers[0] is not None, f"{request.key}: no answer to {payload[:20]!r}"
            assert not answers[0].ok, f"{request.key} took {payload[:20]!r}"
            assert msgspec.msgpack.decode(answers[0].payload, type=Failure).message


@pytest.mark.usefixtures("nothing_moves_and_nothing_dies")
def test_trajectories_that_may_not_run_are_refused_by_name(operator):
    names = operator.arm.joint_names
    here = operator.seen[-1].position
    first = operator.arm.joints[0]

    def two_points(start, end, joints=names, seconds=5.0):
        points = (TrajectoryPoint(positions=start), TrajectoryPoint(positions=end, time_from_start=seconds))
        return JointTrajectory(joint_names=joints, points=points)

    elsewhere = (here[0] + 0.3, *here[1:])
    beyond = (first.upper + 0.1, *here[1:])
    for trajectory, words in [
        (two_points(elsewhere, elsewhere), (first.name,)),
        (two_points(here, beyond), (first.name, "limit")),
        (two_points(here, (here[0] + 0.5, *here[1:]), seconds=0.05), (first.name,)),
        (two_points(here, here, joints=("elbow", *names[1:])), ("elbow",)),
        (two_points(here[:2], here[:2]), ()),
        (JointTrajectory(joint_names=names), ()),
    ]:
        with pytest.raises(GoalRefused) as refused:
            operator.follow.send(FollowJointTrajectoryGoal(trajectory=trajectory))
        assert refused.value.reason
        for word in words:
            assert word in str(refused.value.reason)


@pytest.mark.usefixtures("nothing_moves_and_nothing_dies")
def test_rubbish_and_stale_commands_on_every_mqtt_topic_move_nothing(wire, operator):
    status = operator.node.latest(DEVICE_STATUS)
    assert operator.wait_for(lambda: status.message is not None and operator.device.message is not None, 60.0)
    who: DeviceStatus = status.message
    before: DeviceState = operator.device.message
    prefix = f"gemelo/v1/{who.device}"
    noise = random.Random(7)
    for topic in ("traj", "traj/ack", "cmd", "cmd/ack", "hb", "sync", "sync/r", "state", "event", "status"):
        for payload in (noise.randbytes(40), b"", b"{", b'{"online": 7}', b"g\x01\x01\x03", bytes(MEGABYTE)):
            wire.publish(f"{prefix}/{topic}", payload).wait_for_publish(5.0)
    start = tuple(steps * 256 for steps in before.steps)
    away = tuple(each + 256 * 20 for each in start)
    still = (0,) * len(start)

    def chunk(boot_id, expires_us, rows=(start, away)):
        return to_frame(
            Chunk(
                boot_id=boot_id, stream=99, seq=0, expires_us=expires_us, dt_us=250_000,
                flags=ChunkFlag.FIRST | ChunkFlag.LAST, positions=rows, velocities=(still,) * len(rows),
            )
        )  # fmt: skip

    later = before.device_time + 3_600_000_000
    refused = [
        chunk(who.boot_id ^ 1, later),
        chunk(who.boot_id, LONG_AGO),
        chunk(who.boot_id, later, rows=(away, start)),
        chunk(who.boot_id, later, rows=(start, tuple(2**30 for _ in start))),
    ]
    for frame in refused:
        wire.publish(f"{prefix}/traj", frame, qos=1).wait_for_publish(5.0)
    wire.publish(
        f"{prefix}/cmd", to_frame(CommandFrame(boot_id=who.boot_id, cmd_id=1, expires_us=LONG_AGO, cmd=3)), qos=1
    )
    wire.publish(f"{prefix}/hb", to_frame(Heartbeat(boot_id=who.boot_id ^ 1, session=1, counter=1)))
    assert operator.wait_for(lambda: operator.device.message.refused >= before.refused + len(refused) + 1, 60.0)
    assert operator.wait_for(lambda: operator.device.message.bad_frames > before.bad_frames, 60.0)


@pytest.fixture(scope="module")
def neighbour(stack):
    stack.wait_ready(120.0)
    person = Neighbour(stack)
    yield person
    person.close()


@pytest.mark.parametrize("topic", KEYS, ids=lambda topic: topic.key)
def test_extreme_strays_on_a_key_keep_nothing_from_working(topic, stack, neighbour):
    assert neighbour.wait_for(lambda: len(neighbour.bad) > 0, 60.0)
    before = neighbour.readers(topic.key)
    pids = stack.pids()
    count = neighbour.put_strays(topic)
    stack.wait_ready(120.0)
    assert neighbour.wait_for(neighbour.moves_a_little, 60.0), neighbour.objection
    assert stack.pids() == pids
    if topic.delivery is Delivery.LATCHED:
        has_dropped = neighbour.wait_for(lambda: neighbour.has_dropped(topic.key, before, count), 60.0)
        assert has_dropped, (before, count, neighbour.readers(topic.key))
