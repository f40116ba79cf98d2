"""Streamed targets with eyes on them: followed as ever where the way is free, stopped clear of what is in it."""

from __future__ import annotations

import random

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceEvent, DeviceMode
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import COMMANDS, DEVICE_EVENTS, STEP_ERRORS, STREAM_PATHS
from gemelo.services.planner.collision.world import World
from gemelo.services.stepper_gateway.inputs import ParametersInput
from gemelo.tools.bench.leaders import Sender, lead, person
from gemelo.tools.bench.scenes import parol6
from gemelo.tools.bench.stream_lag import lag_of
from gemelo.tools.bench.watched_arm import WatchedArm, world_with
from gemelo.tools.virtual_arm.gateway_driver import GatewayParameters, TargetsInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import assert_within_limits
from tests.stepper_gateway.live import persons, replacements, violations

ARMS = {"rm1": rm1(), "parol6": parol6()}
PERIOD = 1 / 30  # [s]
POST = (0.04, 0.04, 0.6)  # [m]


def post_before(name: str, angle: float = 0.5) -> World:
    """A post where the tool of the arm would be with its first joint turned by `angle` [rad] from "ready"."""
    arm = ARMS[name]
    turned = (arm.named_states["ready"][0] + angle, *arm.named_states["ready"][1:])
    x, y, _ = Kinematics(arm).tool(turned).position.tolist()
    return world_with(arm, (POST, (x, y, 0.3)))


def turning(rig: VirtualArm, begin: float, end: float, seconds: float) -> None:
    """Streams the first joint from `begin` to `end` [rad] beside "ready", evenly, and what is over of 2 s there."""
    ready = rig.arm.named_states["ready"]
    for index in range(round((seconds + 2.0) / PERIOD)):
        share = min(1.0, index * PERIOD / seconds)
        place = (ready[0] + begin + share * (end - begin), *ready[1:])
        rig.handle(TargetsInput(JointTargets(stamp=rig.moment.unix, name=rig.arm.joint_names, position=place)))
        rig.run(PERIOD)


def rig_at_ready(name: str, world: World, **named: float) -> WatchedArm:
    arm = ARMS[name]
    rig = WatchedArm(arm=arm, start=arm.named_states["ready"], world=world)
    rig.ready()
    if named:
        rig.handle(ParametersInput(GatewayParameters(**named)))
    return rig


def refusals(rig: VirtualArm) -> list[DeviceEvent]:
    return [event for event in rig.messages(DEVICE_EVENTS) if event.event == "target_refused"]


def obstructions(rig: VirtualArm) -> list[DeviceEvent]:
    return [event for event in rig.messages(DEVICE_EVENTS) if event.event == "target_obstructed"]


@pytest.mark.parametrize("name", ARMS)
def test_a_free_way_is_followed_with_the_lag_of_an_unwatched_one(name: str) -> None:
    arm = ARMS[name]
    signal = person(arm.joints[0], 3, 10.0)
    lag = lag_of(WatchedArm, arm, signal, Sender(30.0))
    assert lag.median < 45.0
    assert lag.p99 < 80.0


@pytest.mark.parametrize("name", ARMS)
def test_the_arm_stands_clear_of_what_is_in_its_way_and_says_what_it_is(name: str) -> None:
    rig = rig_at_ready(name, post_before(name))
    turning(rig, 0.0, 1.0, 2.0)
    assert rig.nearest() > rig.arm.clearance
    assert rig.world.distance(np.array(rig.position)) < 0.02
    assert not any(rig.state.velocity)
    why = obstructions(rig)[0].why
    assert why is not None
    assert why.code == "target.obstructed"
    assert why.causes[0].code == "jog.limit.collision"
    assert "box_0" in why.causes[0].values.values()
    assert not violations(rig, rig.path)
    told = len(obstructions(rig))
    turning(rig, 0.0, -0.3, 1.0)  # the way back is free
    assert rig.position[0] == pytest.approx(rig.arm.named_states["ready"][0] - 0.3, abs=0.02)
    assert len(obstructions(rig)) == told
    assert not refusals(rig)
    assert max(abs(error) for message in rig.messages(STEP_ERRORS) for error in message.error) <= 0.5 + 1 / 256


@pytest.mark.parametrize("name", ARMS)
def test_a_jump_through_a_thing_is_not_made(name: str) -> None:
    rig = rig_at_ready(name, post_before(name))
    turning(rig, 1.0, 1.0, 1.0)
    assert rig.nearest() > rig.arm.clearance
    assert rig.position[0] < rig.arm.named_states["ready"][0] + 0.5


@pytest.mark.parametrize("margin", [0.01, 0.018])
def test_the_margin_stays_free(margin: float) -> None:
    rig = rig_at_ready("parol6", post_before("parol6"), stream_margin=margin)
    turning(rig, 0.0, 1.0, 2.0)
    assert margin < rig.nearest() < margin + 0.02


def among_boxes(arm: ArmDescription, chance: random.Random) -> World:
    """Four boxes about the arm, none of which is near to it at "ready"."""
    ready = np.array(arm.named_states["ready"])
    while True:
        places = [(chance.uniform(-0.5, 0.5), chance.uniform(-0.5, 0.5), chance.uniform(0.0, 0.5)) for _ in range(4)]
        world = world_with(arm, *(((chance.uniform(0.03, 0.2),) * 3, place) for place in places))
        if world.distance(ready) > 0.012:
            return world


def wander(rig: VirtualArm, chance: random.Random, seconds: float) -> None:
    """Streams the way to one configuration after the other, by jumps and evenly, without a care for what is there."""
    joints, here = rig.arm.joints, rig.position
    ready = goal = here
    for index in range(round(seconds / PERIOD)):
        if index % 15 == 0:
            reach = [1.2 if joint.unit == "rad" else 0.12 for joint in joints]
            goal = tuple(
                joint.clamp(p + chance.uniform(-r, r)) for joint, p, r in zip(joints, ready, reach, strict=True)
            )
            share = chance.choice((0.1, 0.3, 1.0))
        here = tuple(a + share * (b - a) for a, b in zip(here, goal, strict=True))
        rig.handle(TargetsInput(JointTargets(stamp=rig.moment.unix, name=rig.arm.joint_names, position=here)))
        rig.run(PERIOD + chance.uniform(-0.01, 0.01))
    rig.run(1.0)


WANDERERS = [("rm1", 0), ("parol6", 9)]
MORE = [(name, seed) for name in ARMS for seed in range(24) if (name, seed) not in WANDERERS]


@pytest.mark.parametrize(("name", "seed"), [*WANDERERS, *(pytest.param(*row, marks=pytest.mark.full) for row in MORE)])
def test_wherever_the_targets_wander_among_boxes_the_arm_stays_clear_and_within_its_limits(
    name: str, seed: int
) -> None:
    arm, chance = ARMS[name], random.Random(seed)
    world = among_boxes(arm, chance)
    wire = VirtualWire(delay=0.003, jitter=0.01, loss=0.03)
    rig = WatchedArm(wire, arm=arm, start=arm.named_states["ready"], world=world, seed=seed)
    rig.ready().run(0.3)
    rig.path.clear()
    wander(rig, chance, 6.0)
    assert rig.nearest(5) > arm.clearance
    assert obstructions(rig) or (name, seed) not in WANDERERS
    assert not violations(rig, rig.path)


def test_a_stream_that_nobody_watches_any_more_stops_and_does_not_go_on_by_itself() -> None:
    rig = rig_at_ready("rm1", world_with(ARMS["rm1"]))
    turning(rig, 0.0, 0.3, 1.5)

    def stream(seconds: float, slope: float) -> None:
        begin = rig.position[0]
        for index in range(round(seconds / PERIOD)):
            rig.target(brazo_joint=begin + slope * PERIOD * index)
            rig.run(PERIOD)

    stream(1.0, 0.2)
    rig.takes = None
    stream(0.2, 0.2)
    before = rig.messages(COMMANDS)[-1].stamp
    stream(0.5, 0.2)
    assert rig.messages(COMMANDS)[-1].stamp == before
    assert refusals(rig)[-1].why.code == "target.unwatched"  # type: ignore[union-attr]
    assert not any(rig.state.velocity)
    rig.takes = 0.004
    stream(1.0, 0.2)
    stood = rig.device.steps
    stream(1.0, 0.2)
    assert rig.device.steps == stood
    rig.run(1.0)
    stream(1.0, -0.2)
    assert rig.device.steps != stood
    assert_within_limits(rig)


def test_without_a_planner_no_streamed_target_moves_the_arm() -> None:
    rig = rig_at_ready("rm1", world_with(ARMS["rm1"]))
    rig.takes, stood = None, rig.device.steps
    turning(rig, 0.0, 0.3, 2.0)
    assert rig.device.steps == stood
    assert not rig.messages(COMMANDS)
    assert refusals(rig)[0].why == because("target.unwatched", time=3.0)
    assert rig.device.mode is DeviceMode.IDLE


def test_who_wants_no_eyes_is_told_so_once_a_stream() -> None:
    rig = rig_at_ready("rm1", post_before("rm1"), watch_streams=False)
    turning(rig, 0.0, 0.2, 1.0)
    told = [event.why.code for event in rig.messages(DEVICE_EVENTS) if event.event == "target_unwatched" and event.why]
    assert told == ["target.by_choice"]
    assert not rig.messages(STREAM_PATHS)
    assert replacements(rig) > 50


def test_a_planner_that_stalls_for_a_moment_is_waited_for_while_the_arm_brakes() -> None:
    rig = rig_at_ready("rm1", world_with(ARMS["rm1"]))
    begin = rig.position[0]
    for index in range(90):
        rig.takes = 0.3 if index == 40 else 0.004
        rig.target(brazo_joint=begin + 0.2 * PERIOD * index)
        rig.run(PERIOD)
    assert not refusals(rig)
    assert rig.position[0] == pytest.approx(begin + 0.2 * 89 * PERIOD, abs=0.02)
    assert not violations(rig, rig.path)


def test_what_the_planner_has_looked_at_itself_is_not_looked_at_again() -> None:
    rig = rig_at_ready("rm1", world_with(ARMS["rm1"]))
    begin = rig.position[0]
    for index in range(30):
        targets = JointTargets(stamp=rig.moment.unix, name=("brazo_joint",), position=(begin + 0.005 * index,))
        rig.handle(TargetsInput(targets, "client", watched=True))
        rig.run(PERIOD)
    assert not rig.messages(STREAM_PATHS)
    assert rig.position[0] > begin + 0.1


def test_a_jog_does_not_wait_for_what_was_asked_about_another_stream() -> None:
    rig = rig_at_ready("rm1", world_with(ARMS["rm1"]))
    rig.takes, begin = None, rig.position[0]
    rig.target(brazo_joint=begin)
    for index in range(30):
        targets = JointTargets(stamp=rig.moment.unix, name=("brazo_joint",), position=(begin + 0.005 * index,))
        rig.handle(TargetsInput(targets, "client", watched=True))
        rig.run(PERIOD)
    assert rig.position[0] > begin + 0.1


@pytest.mark.parametrize("takes", [0.001, 0.015, 0.04])
def test_however_long_a_look_takes_the_account_is_exact(takes: float) -> None:
    arm = ARMS["parol6"]
    wire = VirtualWire(delay=0.002, jitter=0.02, loss=0.05, duplicates=0.05)
    rig = WatchedArm(wire, arm=arm, start=arm.named_states["ready"], takes=takes, seed=3)
    rig.ready().run(0.5)
    rig.path.clear()
    lead(rig, persons(arm, 4, 4.0, 0.5), 4.0, Sender(30.0, jitter=0.01), 2)
    assert not violations(rig, rig.path)
    assert max(abs(error) for message in rig.messages(STEP_ERRORS) for error in message.error) <= 0.5 + 1 / 256
    assert replacements(rig) > 30


def test_the_same_inputs_give_the_same_paths() -> None:
    first, second = (rig_at_ready("rm1", post_before("rm1")) for _ in range(2))
    for rig in (first, second):
        turning(rig, 0.0, 0.6, 1.0)
    assert [msgspec.structs.replace(p, stamp=0, session=0).positions for p in first.messages(STREAM_PATHS)] == [
        path.positions for path in second.messages(STREAM_PATHS)
    ]
