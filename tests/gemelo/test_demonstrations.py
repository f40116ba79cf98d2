"""Demonstrations: recorded whatever moves the arm, played back to the step, slower, and not into what is in the way."""

from __future__ import annotations

import math
import threading

import pytest

import gemelo
from gemelo.programs import (
    Go,
    Play,
    Points,
    Program,
    ProgramError,
    ProgramRun,
    Programs,
    check_program,
    export_script,
)
from gemelo.programs.demonstrations import (
    Demonstrations,
    plan_of,
    play_demonstration,
    record_demonstration,
)
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.cli.common.errors import ExitCode
from tests.simulated import TypedAt

BRAZO, ANTEBRAZO = "brazo_joint", "antebrazo_joint"


@pytest.fixture
def kept(tmp_path, arm):
    return Demonstrations(tmp_path, arm.description)


def shown_by(arm, show):
    """What is recorded while `show(person)` runs, as a person would do it at another terminal."""
    done = threading.Event()

    def run() -> None:
        with arm.sim.connect("person") as person:
            show(person)
            person.wait_for(lambda: False, 0.3)
        done.set()
        arm.wake()

    thread = arm.node.clock.thread(run, "person")
    thread.start()
    try:
        return record_demonstration(arm, done.is_set, 60.0)
    finally:
        thread.join()


def jogged(person):
    person.wait_for(lambda: False, 0.3)
    person.jog(joints={BRAZO: 0.4, ANTEBRAZO: -0.3}, duration=1.0)
    person.wait_for(lambda: False, 0.5)
    person.jog(joints={BRAZO: -0.2}, duration=0.5)


def states_of(arm, play):
    """[ns] and [rad] of the first two joints, from the first motion on, while `play()` runs."""
    found = []
    with arm.sim.node("watcher") as watcher:
        watcher.subscribe(JOINT_STATES, lambda each: found.append((each.stamp, each.position[:2])))
        watcher.begin(rate=1.0)
        play()
        arm.sim.sleep(0.3)
    return found


def trace(states, start):
    """The positions by the time [s] since the arm left `start` [rad]."""
    moving = next(index for index, (_, at) in enumerate(states) if math.dist(at, start) > 1e-3)
    return [((stamp - states[moving][0]) * 1e-9, at) for stamp, at in states[moving:]]


def at_time(rows, time):
    return min(rows, key=lambda row: abs(row[0] - time))[1]


@pytest.fixture
def ready(arm):
    arm.move(named="home")
    return arm


def test_what_was_jogged_is_played_back_to_the_step_and_to_the_same_times(ready, kept):
    arm, recorded = ready, []
    shown = []

    def show():
        shown.append(shown_by(arm, jogged))

    recorded = states_of(arm, show)
    kept.save("wave", shown[0])
    demonstration = kept["wave"]
    assert demonstration == shown[0]
    end = arm.joints
    arm.move(named="home")
    start = tuple(demonstration.start.values())[:2]
    played = states_of(arm, lambda: play_demonstration(arm, demonstration))
    assert arm.joints == pytest.approx(end, abs=1e-6)  # the very same steps
    assert max(map(abs, arm.step_errors.values())) <= 0.5
    first, second = trace(recorded, start), trace(played, start)
    for time in (0.2, 0.5, 0.9, 1.3, 1.8):
        assert at_time(second, time) == pytest.approx(at_time(first, time), abs=0.02)  # a step of antebrazo is 0.016


def test_rests_at_both_ends_are_left_out_and_those_between_are_kept(ready):
    demonstration = shown_by(ready, jogged)
    assert 2.0 < demonstration.duration < 3.5
    assert demonstration.velocities[0] == demonstration.velocities[-1] == (0.0, 0.0, 0.0)
    assert list(demonstration.times) == sorted(set(demonstration.times))


def test_half_as_fast_is_the_same_path(ready):
    demonstration = shown_by(ready, jogged)
    slow = plan_of(demonstration, 0.5)
    assert slow.duration == pytest.approx(2.0 * demonstration.duration)
    assert [point.positions for point in slow.trajectory.points] == list(demonstration.positions)
    began = ready.sim.now
    motion = play_demonstration(ready, demonstration, 0.5)
    assert motion.status.name == "SUCCEEDED"
    assert ready.sim.now - began > slow.duration
    assert ready.joints == pytest.approx(demonstration.end, abs=0.01)


def test_faster_than_the_arm_can_is_refused_by_the_gateway_with_the_joint(ready):
    demonstration = shown_by(ready, jogged)
    with pytest.raises(gemelo.Refused, match="joint"):
        play_demonstration(ready, demonstration, 9.0)


def test_the_gripper_is_part_of_it(ready):
    ready.grip("open")

    def show(person):
        person.move(joints={BRAZO: 0.3})
        person.grip(0.02)
        person.move(joints={BRAZO: 0.0})

    demonstration = shown_by(ready, show)
    assert [to for _, to in demonstration.gripper] == pytest.approx([0.02])
    ready.grip("open")
    play_demonstration(ready, demonstration)
    assert ready.gripper.position == pytest.approx(0.02, abs=0.002)


def test_what_stands_in_the_way_now_is_refused_with_its_time_before_anything_moves(ready):
    demonstration = shown_by(ready, jogged)
    ready.move(named="home")
    before = ready.joints
    middle = demonstration.positions[len(demonstration.positions) // 2]
    ready.scene.add_box(
        "wall", (0.04, 0.04, 0.2), at=ready.fk(dict(zip(demonstration.joints, middle, strict=True))).position
    )
    with pytest.raises(gemelo.Refused) as caught:
        play_demonstration(ready, demonstration)
    assert caught.value.reason.code == "demonstration.touches"
    assert 0.0 < caught.value.reason.values["time"] < demonstration.duration
    assert ready.joints == before


def test_what_cannot_be_is_refused_by_its_code(ready, kept, tmp_path):
    with pytest.raises(gemelo.BadArgument) as caught:
        record_demonstration(ready, lambda: False, 0.5)
    assert caught.value.reason.code == "demonstration.still"
    demonstration = shown_by(ready, jogged)
    kept.save("wave", demonstration)
    with pytest.raises(gemelo.BadArgument) as caught:
        kept.save("wave", demonstration)
    assert caught.value.reason.code == "demonstration.there"
    kept.save("wave", demonstration, overwrite=True)
    with pytest.raises(gemelo.BadArgument) as caught:
        kept.require("wawe")
    assert caught.value.reason.code == "demonstration.unknown"
    with pytest.raises(gemelo.BadArgument) as caught:
        play_demonstration(ready, demonstration, 0.0)
    assert caught.value.reason.code == "demonstration.speed"
    kept.file("wrong").write_text('{"robot": "rm1"}')
    with pytest.raises(ProgramError, match="cannot be read"):
        kept["wrong"]
    assert list(kept) == ["wave", "wrong"]


def test_a_recording_that_begins_in_a_motion_is_refused(ready):
    ready.start(joints={BRAZO: 1.0})
    ready.sim.sleep(0.5)
    with pytest.raises(gemelo.BadArgument) as caught:
        record_demonstration(ready, lambda: False, 4.0)
    assert caught.value.reason.code == "demonstration.moving"


def test_the_commands_list_and_play_it(ready, tmp_path, monkeypatch):
    monkeypatch.setenv("GEMELO_PATHS_PROGRAMS", str(tmp_path))
    typed = TypedAt(ready)
    assert "gemelo teach record" in typed("teach", "list")
    Demonstrations(tmp_path, ready.description).save("wave", shown_by(ready, jogged))
    assert "wave" in typed("teach", "list")
    assert '"wave" played in' in typed("teach", "play", "wave", "--speed", "80%")
    assert "did you mean" in typed("teach", "play", "wav", code=ExitCode.USAGE)
    assert "--overwrite" in typed("teach", "record", "wave", code=ExitCode.USAGE)
    said = typed("teach", "record", "other", "--duration", "0.3", code=ExitCode.USAGE)
    assert "has not moved" in said


@pytest.fixture
def waving(ready, tmp_path, monkeypatch):
    """A program that plays a demonstration, and what it is run with."""
    monkeypatch.setattr("gemelo.programs.demonstrations.programs_folder", lambda arm: tmp_path)
    Demonstrations(tmp_path, ready.description).save("wave", shown_by(ready, jogged))
    ready.move(named="home")
    steps = (Go(state="left"), Play(demonstration="wave", share=0.8), Go(state="home"))
    Program("greet", steps).save(tmp_path)
    programs = Programs(tmp_path)
    return programs["greet"], Points.load(tmp_path, ready.description), programs


def test_a_program_checks_and_plays_it_as_a_step_between_others(ready, waving, tmp_path):
    program, points, programs = waving
    assert 'share = "80%"' in (tmp_path / "greet.toml").read_text()
    assert program.steps[1] == Play(demonstration="wave", share=0.8)
    check = check_program(ready, program, points, programs)
    assert check.ok, check.refusals
    assert check.legs[1].duration > Demonstrations(tmp_path, ready.description)["wave"].duration / 0.8
    run = ProgramRun(ready, program, points, programs)
    run.start()
    state = run.wait(120.0)
    assert (state.status.name, state.done) == ("DONE", 3), state.message
    assert ready.joints == pytest.approx(ready.states["home"], abs=0.01)
    script = export_script(program, points, programs)
    assert 'play_demonstration(arm, demonstrations_of(arm).require("wave"), 0.8)' in script
    compile(script, "greet.py", "exec")


def test_a_program_that_is_stopped_while_it_plays_lets_the_arm_rest(ready, waving):
    program, points, programs = waving
    run, states = ProgramRun(ready, program, points, programs), ready.node.latest(JOINT_STATES)
    run.start((1,))
    assert ready.wait_for(lambda: states.message is not None and abs(states.message.velocity[0]) > 0.1, 20.0)
    run.stop()
    assert run.wait(20.0).status.name == "STOPPED"
    assert max(map(abs, ready.velocities.values())) < 1e-2


def test_a_step_without_its_demonstration_fails_the_check_with_the_nearest_name(ready, waving):
    _, points, programs = waving
    program = Program("other", (Play(demonstration="wawe"),))
    check = check_program(ready, program, points, programs)
    assert not check.ok
    assert check.legs[0].refusal.reason.code == "demonstration.unknown"
    wrong = check_program(ready, Program("third", (Play(demonstration="wave", share=0.0),)), points, programs)
    assert [each.reason.causes[0].code for each in wrong.mistakes] == ["demonstration.speed"]
