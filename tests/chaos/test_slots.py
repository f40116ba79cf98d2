"""The judge of every slot of a virtual device."""

from __future__ import annotations

import numpy as np

from gemelo.firmware.platform.host.slot_record import STOOD, row
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.tools.chaos import slots


def written(config, counts: list[int], boots: list[int] | None = None) -> np.ndarray:
    """What a device records when the first joint's counter changes so from slot to slot."""
    others = (0,) * (len(config.joints) - 1)
    rows = [
        row(slot * 1000, boot, (count, *others))
        for slot, (count, boot) in enumerate(zip(counts, boots or [1] * len(counts), strict=True))
    ]
    return np.frombuffer(b"".join(rows), slots.ROWS)


def test_the_judge_of_slots_passes_the_fastest_start_and_names_a_faster_one(rm1):
    config = device_config(rm1)
    pull = config.joints[0].max_acceleration_q8 / slots.Q8
    speed = config.joints[0].max_velocity_q8 / slots.Q8

    def start(factor: float) -> list[int]:
        """Accelerating, then at speed."""
        last = factor * speed
        times = [slot * 1e-3 for slot in range(3000)]
        turn = last / (factor * pull)
        return [round(factor * pull * min(t, turn) ** 2 / 2 + last * max(0.0, t - turn)) for t in times]

    assert slots.violations(config, written(config, start(1.0))) == []
    assert slots.violations(config, written(config, start(1.0 + slots.MARGIN))[:700]) == []  # as it speeds up
    assert any(each.code == "chaos.slots.jerk" for each in slots.violations(config, written(config, start(1.13))[:700]))
    assert any(each.code == "chaos.slots.jerk" for each in slots.violations(config, written(config, start(1.3))))
    assert any(each.code == "chaos.slots.jump" for each in slots.violations(config, written(config, start(1.3))))


def test_what_stops_from_one_slot_to_the_next_has_broken_its_acceleration_unless_its_drivers_went_off(rm1):
    config = device_config(rm1)
    speed = config.joints[0].max_velocity_q8 / slots.Q8 * 0.9e-3  # [steps] in a slot
    stopped = written(config, [round(speed * min(slot, 100)) for slot in range(200)])
    assert any(each.code == "chaos.slots.jerk" for each in slots.violations(config, stopped))
    assert slots.violations(config, stopped, may_stop_at_once=True) == []


def test_the_judge_of_slots_sees_one_lost_slot_and_no_step_across_a_boot(rm1):
    config = device_config(rm1)
    speed = config.joints[0].max_velocity_q8 / slots.Q8 * 0.9e-3  # [steps] in a slot
    even = [round(speed * slot) for slot in range(200)]
    late = even[:100] + [round(speed * (slot + 60)) for slot in range(100, 200)]
    assert slots.violations(config, written(config, even)) == []
    assert slots.violations(config, written(config, late))
    assert slots.violations(config, written(config, late, [1] * 100 + [2] * 100)) == []
    assert slots.violations(config, written(config, late, [1] * 99 + [STOOD] + [1] * 100)) == []
