"""A link that is cut or slow in the middle of a move: the arm stays within its limits, and the client hears of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from services.arm.device.device_config import device_config
from tests.optional import need, need_root
from tests.stack import slots
from tests.stack.link_cases import CASES, Case
from tests.stack.links import Links
from tests.stack.witness import STOOD, row

# All of them: sudo .venv/bin/python -m tests.stack.links
FEW = ("desk-cut-both-0.2s", "cell-cut-into-1s", "board-slow-300ms", "desk-cut-out-10s-attached")
CHOSEN = [case for case in CASES if case.name in FEW]


@pytest.fixture(scope="module")
def links(tmp_path_factory) -> Iterator[Links]:
    need("mosquitto")
    need_root("tests/stack/test_links.py", with_taps=True)
    with Links(tmp_path_factory.mktemp("links")) as made:
        yield made


@pytest.mark.parametrize("case", CHOSEN, ids=[case.name for case in CHOSEN])
def test_an_arm_whose_link_fails_keeps_to_its_limits_and_its_client_hears_how_it_ended(links: Links, case: Case):
    came = links.run(case)
    assert came.faults == (), came
    assert came.ready_after < float("inf"), links.logs()


def test_every_link_is_cut_in_both_ways_and_each_and_slowed():
    assert len({case.name for case in CASES}) == len(CASES) == 4 * 9 + 4 * 2 + 9
    assert len(CHOSEN) == len(FEW)


def written(config, counts: list[int], boots: list[int] | None = None) -> np.ndarray:
    """What the witness writes when the first joint's counter changes so from slot to slot."""
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
    assert any("changed by" in each for each in slots.violations(config, written(config, start(1.3))))
    assert any("went" in each for each in slots.violations(config, written(config, start(1.3))))


def test_the_judge_of_slots_sees_one_lost_slot_and_no_step_across_a_boot(rm1):
    config = device_config(rm1)
    speed = config.joints[0].max_velocity_q8 / slots.Q8 * 0.9e-3  # [steps] in a slot
    even = [round(speed * slot) for slot in range(200)]
    late = even[:100] + [round(speed * (slot + 60)) for slot in range(100, 200)]
    assert slots.violations(config, written(config, even)) == []
    assert slots.violations(config, written(config, late))
    assert slots.violations(config, written(config, late, [1] * 100 + [2] * 100)) == []
    assert slots.violations(config, written(config, late, [1] * 99 + [STOOD] + [1] * 100)) == []
