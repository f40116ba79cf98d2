"""Messages become columns: in screen units, thinned while nothing moves, and none is lost when something does."""

import itertools
import math
import warnings
from itertools import pairwise

import numpy as np
import pytest

from gemelo.schemas.device import (
    DeviceEvent,
    DeviceFault,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    SensorReadings,
    ShaftPositions,
)
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.thinning import KEEP_ALIVE, ThinnedSeries
from gemelo.services.visualizer.content.updates import LineStrip, LogLines, Poses, Scalars, StateUpdate, TextPanel, Tint
from gemelo.services.visualizer.core import AHEAD

START = 1_795_000_000_000_000_000
NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")


def by_entity(updates):
    return {update.entity: update for update in updates}


def joint_state(*position, stamp=START, name=NAMES):
    return JointState(stamp=stamp, name=name, position=position)


def test_executed_positions_are_shown_in_degrees_and_millimetres(core):
    core.on_joint_state(joint_state(math.pi / 2, -0.1, 0.04))
    updates = by_entity(core.step(START))
    assert updates[entities.executed("brazo_joint")].values == pytest.approx(np.array([[90.0]]))
    assert updates[entities.executed("efector_joint")].values == pytest.approx(np.array([[40.0]]))
    assert updates[entities.executed("brazo_joint")].times.tolist() == [START]


def test_measured_and_commanded_arms_stand_apart(core):
    core.on_joint_state(joint_state(0.0, 0.0, 0.0))
    core.on_joint_command(joint_state(math.pi / 2, 0.0, 0.0))
    updates = by_entity(core.step(START))
    measured = updates[f"{entities.MEASURED}/base_link/brazo_link"]
    commanded = updates[f"{entities.COMMANDED}/base_link/brazo_link"]
    assert isinstance(measured, Poses)
    assert measured.rotations[0] == pytest.approx((0, 0, 0, 1))
    assert commanded.rotations[0] == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


def test_joints_are_taken_by_name_whatever_their_order(core):
    core.on_joint_state(joint_state(0.05, 1.0, name=("efector_joint", "brazo_joint")))
    core.on_joint_state(joint_state(9.9, stamp=START + 1, name=("stranger",)))
    updates = by_entity(core.step(START))
    assert updates[entities.executed("efector_joint")].values[0] == pytest.approx(50.0)
    assert updates[entities.executed("brazo_joint")].values[0] == pytest.approx(math.degrees(1.0))


def test_the_step_error_comes_with_its_band(core):
    core.on_step_errors(StepErrors(stamp=START, name=NAMES, error=(0.1, -0.2, 0.3)))
    values = by_entity(core.step(START))[entities.error("antebrazo_joint")].values
    assert values == pytest.approx(np.array([[-0.2, 0.5, -0.5]]))


def test_a_resting_arm_sends_two_samples_a_second(core):
    count = 0
    for index in range(500):
        now = START + index * 20_000_000
        core.on_joint_state(joint_state(0.1, 0.2, 0.03, stamp=now))
        if index % 5 == 4:
            count += sum(len(u.times) for u in core.step(now) if u.entity == entities.executed("brazo_joint"))
    assert count == pytest.approx(20, abs=1)


def test_thinning_keeps_every_change_and_the_sample_before_it():
    thinned = ThinnedSeries(1)
    for stamp in range(0, 10):
        thinned.add(stamp, (1.0,))
    thinned.add(10, (2.0,))
    thinned.add(10, (3.0,))
    times, rows = thinned.take()
    assert times.tolist() == [0, 9, 10]
    assert rows[:, 0].tolist() == [1.0, 1.0, 2.0]
    thinned.add(10 + KEEP_ALIVE, (2.0,))
    assert thinned.take()[0].tolist() == [10 + KEEP_ALIVE]


def test_one_stamp_far_ahead_does_not_freeze_the_view():
    thinned = ThinnedSeries(1)
    for stamp in (START, START + 10**15, START + 20_000_000, -1):
        thinned.add(stamp, (float(stamp),))
    assert thinned.take()[0].tolist() == [START, START + 10**15, START + 20_000_000]


def test_the_trail_is_one_unbroken_line_and_rests_with_the_arm(core):
    lines = []
    for index in range(1, 31):
        angle = min(index, 20) * 0.02
        core.on_joint_state(joint_state(angle, 0.0, 0.0, stamp=START + index * 20_000_000))
        if index % 5 == 0:
            lines += [update.points for update in core.step(START) if isinstance(update, LineStrip)]
    assert len(lines) == 4
    for before, after in pairwise(lines):
        assert before[-1] == pytest.approx(after[0])


def test_the_planned_path_is_told_once_and_again_to_a_new_viewer(core):
    core.on_planned_path(PlannedPath(stamp=START, points=((0.0, 0.0, 0.0), (0.1, 0.2, 0.3))))
    (path,) = [update for update in core.step(START) if update.entity == entities.PATH]
    assert path.points == pytest.approx(np.array([[0, 0, 0], [0.1, 0.2, 0.3]]))
    assert entities.PATH not in by_entity(core.step(START + 1))
    core.restart()
    assert entities.PATH in by_entity(core.step(START + 2))


def test_logs_and_events_are_lines_with_a_level(core):
    core.event_log.on_log(LogRecord(stamp=START, node="planner", level=LogLevel.WARNING, text="slow"))
    core.event_log.on_event(DeviceEvent(stamp=START, device="rm1", event="fault", detail="TICK_OVERRUN"))
    (lines,) = [update for update in core.step(START) if isinstance(update, LogLines)]
    assert lines.texts == ("11:06:40 planner: slow", "11:06:40 rm1: fault (TICK_OVERRUN)")
    assert lines.levels == ("WARNING", "ERROR")


def device_panel(core, now=START):
    updates = core.step(now)
    text = next(update.markdown for update in updates if isinstance(update, TextPanel))
    mode = next(update.state for update in updates if isinstance(update, StateUpdate))
    return mode, text


def test_before_anything_is_known_the_panel_says_so(core):
    assert device_panel(core) == ("WAITING", "## rm1 · waiting for the device\n")


def test_an_offline_device_says_why(core):
    core.on_device_status(DeviceStatus(stamp=START, online=False, reason="the broker does not answer"))
    mode, text = device_panel(core)
    assert mode == "OFFLINE"
    assert "the broker does not answer" in text


def test_a_silent_device_is_not_called_present(core):
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE))
    assert "SILENT for 3 s" in device_panel(core, START + 3_000_000_000)[1]


def test_the_panel_lists_steps_and_position_per_joint(core):
    core.on_device_status(DeviceStatus(stamp=START, online=True, firmware="1.2.3"))
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.FAULT, fault=1, buffered=0.3))
    core.on_joint_state(joint_state(math.pi / 4, 0.0, 0.0123))
    core.on_step_errors(
        StepErrors(stamp=START, name=NAMES, commanded=(1.25, 2.0, 3.0), executed=(1, 2, 3), error=(0.25, 0.0, 0.0),
                   max_error=(0.5, 0.1, 0.1))
    )  # fmt: skip
    mode, text = device_panel(core)
    assert mode == "FAULT"
    assert text.startswith("# rm1 · TICK_OVERRUN\n\n**the step pulses waited")
    assert "| brazo_joint | 45.00° | 1.25 | 1 | **+0.25** | 0.50 |" in text
    assert "12.30 mm" in text
    assert "300 ms queued" in text
    assert "firmware 1.2.3" in text


def test_a_fault_stands_in_capitals_with_joint_and_remedy(core):
    fault = int(DeviceFault.LIMIT_SWITCH)
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.FAULT, fault=fault, fault_joint="brazo_joint"))
    text = device_panel(core)[1]
    assert text.startswith("# rm1 · LIMIT_SWITCH AT BRAZO_JOINT\n\n**its limit switch was pressed**")
    assert "`gemelo reset`, `gemelo home`" in text


def test_the_panel_says_what_is_not_as_usual_in_bold(core):
    core.on_device_state(
        DeviceState(stamp=START, mode=DeviceMode.UNREFERENCED, name=NAMES, referenced=(True, False, True), speed=0.5,
                    inputs=("estop",), outputs=("avanzar",))
    )  # fmt: skip
    core.on_sensors(SensorReadings(stamp=START, name=("ultra", "bateria"), value=(12.5, 7.41), unit=("cm", "")))
    line = device_panel(core)[1].split("\n\n")[1].strip()
    assert line == (
        "**DISARMED** · **UNREFERENCED antebrazo_joint** · **speed 50%** · **pressed: estop** · on: avanzar · "
        "ultra 12.5 cm · bateria 7.41"
    )


def test_the_panel_is_short_where_all_is_well(core):
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE, name=NAMES, referenced=(True,) * 3, armed=True))
    assert "\n\narmed · all joints referenced\n" in device_panel(core)[1]


def test_readings_that_are_no_longer_fresh_are_left_out(core):
    core.on_device_state(DeviceState(stamp=START + 3_000_000_000, mode=DeviceMode.IDLE))
    core.on_sensors(SensorReadings(stamp=START, name=("ultra",), value=(12.5,), unit=("cm",)))
    assert "ultra" not in device_panel(core, START + 3_000_000_000)[1]


def shaft(stamp, *shafts):
    return ShaftPositions(stamp=stamp, name=NAMES, steps=(100, 200, 300), shaft=shafts)


def test_a_shaft_that_leaves_its_counter_is_a_series_a_line_and_a_warning_in_the_panel(core):
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE))
    core.on_shaft(shaft(START, 100, 201, 300))
    updates = by_entity(core.step(START))
    assert updates[entities.shaft("antebrazo_joint")].values.tolist() == [[0.0]]
    assert entities.LOG not in updates
    assert "STEPS LOST" not in updates[entities.PANEL].markdown
    later = START + 1_000_000_000
    core.on_shaft(shaft(later, 63, 201, 300))
    core.on_shaft(shaft(later + 1, 60, 201, 300))
    updates = by_entity(core.step(later))
    assert updates[entities.shaft("brazo_joint")].values.tolist() == [[-37.0], [-40.0]]
    assert updates[entities.LOG].texts == ("11:06:41 brazo_joint: its shaft is -37 steps from its counter",)
    assert updates[entities.LOG].levels == ("ERROR",)
    assert "**STEPS LOST: true shaft minus counter brazo_joint -40** · `gemelo home brazo_joint`" in (
        updates[entities.PANEL].markdown
    )


def test_the_arm_changes_its_colour_with_the_mode_and_a_new_viewer_is_told(core):
    def tints(now):
        return [update.mode for update in core.step(now) if isinstance(update, Tint)]

    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE))
    assert tints(START) == ["IDLE"]
    assert tints(START + 1_000_000_000) == []
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.ESTOP))
    assert tints(START + 2_000_000_000) == ["ESTOP"]
    core.restart()
    assert tints(START + 3_000_000_000) == ["ESTOP"]


def test_every_update_is_finite_and_ordered(core):
    for index in range(50):
        core.on_joint_state(joint_state(0.01 * index, 0.0, 0.0, stamp=START + index * 20_000_000))
    for update in core.step(START):
        if isinstance(update, Scalars | Poses):
            assert np.all(np.diff(update.times) > 0)


def test_values_that_no_joint_can_have_are_drawn_at_the_edge_without_an_overflow(core):
    for index, value in enumerate((1e308, -1e308, 0.5)):
        stamp = START + index * 20_000_000
        core.on_joint_state(JointState(stamp=stamp, name=NAMES, position=(value,) * len(NAMES)))
        core.on_step_errors(StepErrors(stamp=stamp, name=NAMES, error=(value,) * len(NAMES)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        updates = by_entity(core.step(START))
    for entity in (entities.executed("brazo_joint"), entities.error("brazo_joint")):
        assert np.all(np.isfinite(updates[entity].values))
    assert updates[entities.error("brazo_joint")].values[-1][0] == 0.5


def test_a_stamp_of_the_far_future_does_not_take_the_view_with_it(core):
    """The view follows the latest time that it was ever told: one false stamp, and it would never come back."""
    for stamp in (2**62, START + 20_000_000):
        core.on_joint_state(JointState(stamp=stamp, name=NAMES, position=(0.5,) * len(NAMES)))
        core.event_log.on_log(LogRecord(stamp=stamp, node="anybody", text="here"))
    updates = core.step(START + 30_000_000)
    times = [int(time) for update in updates if hasattr(update, "times") for time in update.times]
    assert START + 20_000_000 in times
    assert max(times) <= START + AHEAD + 30_000_000


def test_a_viewer_that_comes_late_finds_the_mode_and_the_newest_line_among_the_newest_data(core):
    """The viewer's server keeps some minutes: what was said once, before them, is gone for who comes later."""
    second = 1_000_000_000
    core.event_log.on_log(LogRecord(stamp=START, node="planner", text="ready"))
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE))
    seen = [update for at in range(301) for update in core.step(START + at * second)]
    modes = [update.time for update in seen if isinstance(update, StateUpdate)]
    assert max(after - before for before, after in itertools.pairwise(modes)) <= 6 * second
    lines = [update for update in seen if isinstance(update, LogLines)]
    assert [each.texts for each in lines][:2] == [
        ("11:06:40 planner: ready",), ("11:07:40 nothing new since 11:06:40: planner: ready",),
    ]  # fmt: skip
    assert len(lines) == 6
    assert len([update for update in seen if isinstance(update, Tint)]) == 1  # what costs more is sent when it changes
