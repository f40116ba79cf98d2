"""The README's table and picture show the pins that the board is really given."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import pytest

from gemelo.firmware.draw_wiring import HEIGHT, PICTURE, WIDTH, draw, read_pins

ROOT = Path(__file__).parents[2]
README = (ROOT / "firmware/README.md").read_text()


def _documented() -> dict[str, list[int]]:
    rows = re.findall(r"^\| ([\d, ]+) \| (.+?) \|", README, re.MULTILINE)
    return {what: [int(pin) for pin in pins.split(",")] for pins, what in rows}


def test_the_readme_names_the_pins_of_robot_toml() -> None:
    pins = read_pins()
    expected = {f"STEP, DIR of {joint}": [pins.step[joint], pins.dir[joint]] for joint in ("q1", "q2", "q3")}
    expected["drivers' enable, active low, 10 k to 3.3 V"] = [pins.enable]
    expected["e-stop, second contact"] = [pins.part["estop"]]
    expected["limit and home switch of q1, q2, q3"] = [pins.part[f"limit_q{joint}"] for joint in (1, 2, 3)]
    expected["`bateria`, two cells"] = [pins.part["bateria"]]
    expected["`ultra`: trigger, echo"] = [pins.trigger, pins.part["ultra"]]
    expected["`avanzar`"] = [pins.part["avanzar"]]
    expected["gripper: signal of the servo"] = [pins.servo]
    expected["`pinza`: the servo's potentiometer"] = [pins.part["pinza"]]
    assert _documented() == expected


def test_the_picture_is_what_robot_toml_says_now() -> None:
    assert PICTURE.read_text() == draw(read_pins()).svg(), "remedy: python -m gemelo.firmware.draw_wiring"


def test_no_label_of_the_picture_covers_another_or_leaves_the_paper() -> None:
    labels = draw(read_pins()).labels
    assert len(labels) > 50
    assert [(one.text, other.text) for one, other in combinations(labels, 2) if one.overlaps(other)] == []
    inside = [
        label
        for label in labels
        if label.left >= 0
        and label.top >= 0
        and label.left + label.width <= WIDTH
        and label.top + label.height <= HEIGHT
    ]
    assert inside == labels


@pytest.mark.parametrize("fault", range(1, 8))
def test_every_fault_has_a_row_with_its_remedy(fault: int) -> None:
    assert re.search(rf"^\| fault {fault} [A-Z_]+ \|.+\|.+\|$", README, re.MULTILINE)


def test_every_reset_cause_of_the_board_has_a_row() -> None:
    source = (ROOT / "firmware/platform/esp32/main/reset_cause.cpp").read_text()
    causes = set(re.findall(r'return \{"(\w+)"', source)) - {"unknown"}
    assert len(causes) == 7
    for cause in causes:
        assert f"`{cause}`" in README, cause


def test_the_readme_says_that_no_board_has_run_it() -> None:
    assert "No board has run this yet" in README
