"""`python -m gemelo.firmware.draw_wiring` draws wiring.svg: the wiring of rm1, with the pins of urdf/rm1/robot.toml.

A net that is named in a flag is one wire wherever that flag stands.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from gemelo.firmware.schematic import GROUND, INK, POWER, SAFETY, SIGNAL, Drawing

HERE = Path(__file__).resolve().parent
ROBOT = HERE.parent / "urdf/rm1/robot.toml"
PICTURE = HERE / "wiring.svg"

WIDTH, HEIGHT = 1360, 1010
BOARD_LEFT, BOARD_RIGHT = 560, 740


@dataclass(frozen=True)
class Pins:
    """GPIO numbers by what is wired to them."""

    step: dict[str, int]
    dir: dict[str, int]
    part: dict[str, int]  # switches, outputs and sensors by name
    trigger: int
    enable: int
    servo: int  # of the gripper


def read_pins(robot: Path = ROBOT) -> Pins:
    """The pins of robot.toml."""
    table = tomllib.loads(robot.read_text())
    motors = {joint["wire_name"]: joint["motor"] for joint in table["joint"]}
    parts = table["input"] + table["output"] + table["sensor"]
    return Pins(
        step={name: motor["step_pin"] for name, motor in motors.items()},
        dir={name: motor["dir_pin"] for name, motor in motors.items()},
        part={part["name"]: part["pin"] for part in parts},
        trigger=next(sensor["trigger_pin"] for sensor in table["sensor"] if "trigger_pin" in sensor),
        enable=table["device"]["enable_pin"],
        servo=table["gripper"]["pin"],
    )


def draw(pins: Pins) -> Drawing:
    """The whole picture."""
    drawing = Drawing(WIDTH, HEIGHT)
    drawing.text(30, 36, "rm1: wiring of the ESP32 DevKitC, drivers, switches and sensors", bold=True)
    drawing.text(30, 58, "No board has run it yet. Flags with the same name are connected.", color=SAFETY)
    drawing.box(BOARD_LEFT, 110, BOARD_RIGHT - BOARD_LEFT, 620, "ESP32 DevKitC")
    _switches(drawing, pins)
    _sensors(drawing, pins)
    _gripper(drawing, pins)
    _output_and_supply(drawing, pins)
    _arm_driver(drawing, pins)
    _small_driver(drawing, pins, "q2", 400)
    _small_driver(drawing, pins, "q3", 590)
    _power(drawing)
    return drawing


def _left_pin(drawing: Drawing, y: float, name: str) -> None:
    drawing.text(BOARD_LEFT + 8, y + 4.5, name)


def _right_pin(drawing: Drawing, y: float, name: str) -> None:
    drawing.text(BOARD_RIGHT - 8, y + 4.5, name, "end")


def _switches(drawing: Drawing, pins: Pins) -> None:
    rows = [
        ("e-stop, contact 2 (NC)", "estop", SAFETY),
        ("limit and home q1 (NC)", "limit_q1", SIGNAL),
        ("limit and home q2 (NC)", "limit_q2", SIGNAL),
        ("limit and home q3 (NC)", "limit_q3", SIGNAL),
    ]
    for row, (title, name, color) in enumerate(rows):
        y = 140 + 45 * row
        _left_pin(drawing, y, f"{pins.part[name]} {name}")
        drawing.wire((BOARD_LEFT, y), (400, y), color=color)
        drawing.closed_contact(350, y, color)
        drawing.wire((350, y), (330, y), color=color)
        drawing.flag(330, y, "GND", GROUND, to_left=True)
        drawing.text(270, y + 4.5, title, "end")


def _divider(drawing: Drawing, y: float, upper: str, lower: str) -> None:
    """From x = 330 through `upper` to the pin's row, with `lower` down to ground."""
    drawing.wire((BOARD_LEFT, y), (330, y))
    drawing.resistor(380, y, upper)
    drawing.dot(450, y)
    drawing.wire((450, y), (450, y + 62))
    drawing.resistor(450, y + 30, lower, upright=True)
    drawing.flag(450, y + 62, "GND", GROUND, to_left=True)


def _sensors(drawing: Drawing, pins: Pins) -> None:
    y = 330
    _left_pin(drawing, y, f"{pins.part['bateria']} bateria")
    _divider(drawing, y, "20 k", "10 k")
    drawing.flag(330, y, "battery +", POWER, to_left=True)
    drawing.box(80, 430, 170, 130, "HC-SR04")
    for name, row in (("VCC", 450), ("TRIG", 485), ("ECHO", 520), ("GND", 548)):
        drawing.text(242, row + 4.5, name, "end")
    drawing.wire((250, 450), (280, 450), color=POWER)
    drawing.flag(280, 450, "5 V", POWER)
    _left_pin(drawing, 485, f"{pins.trigger} trigger")
    drawing.wire((250, 485), (BOARD_LEFT, 485))
    _left_pin(drawing, 520, f"{pins.part['ultra']} echo")
    _divider(drawing, 520, "10 k", "20 k")
    drawing.wire((250, 520), (330, 520))
    drawing.wire((250, 548), (280, 548), color=GROUND)
    drawing.flag(280, 548, "GND", GROUND)


def _gripper(drawing: Drawing, pins: Pins) -> None:
    for y, pin, what in (
        (576, f"{pins.part['pinza']} pinza", "potentiometer of the servo, 10 k"),
        (598, f"{pins.servo} gripper", "signal of the servo"),
    ):
        _left_pin(drawing, y, pin)
        drawing.wire((BOARD_LEFT, y), (330, y))
        drawing.text(320, y + 4.5, what, "end")


def _output_and_supply(drawing: Drawing, pins: Pins) -> None:
    y = 625
    _left_pin(drawing, y, f"{pins.part['avanzar']} avanzar")
    drawing.wire((BOARD_LEFT, y), (330, y))
    drawing.resistor(430, y, "330")
    drawing.elements.append(f'<path d="M 380 {y - 9} L 380 {y + 9} L 362 {y} Z" fill="#f2c744" stroke="{INK}"/>')
    drawing.wire((361, y - 9), (361, y + 9), color=INK)
    drawing.flag(330, y, "GND", GROUND, to_left=True)
    drawing.text(270, y + 4.5, "LED avanzar", "end")
    for name, row, net, color in (("5V", 665, "5 V", POWER), ("3V3", 687, "3.3 V", POWER), ("GND", 709, "GND", GROUND)):
        _left_pin(drawing, row, name)
        drawing.wire((BOARD_LEFT, row), (530, row), color=color)
        drawing.flag(530, row, net, color, to_left=True)
    _right_pin(drawing, 709, "USB")
    drawing.wire((BOARD_RIGHT, 709), (775, 709), color=INK)
    drawing.text(783, 704, "computer:")
    drawing.text(783, 722, "921600 baud")


def _arm_driver(drawing: Drawing, pins: Pins) -> None:
    drawing.box(850, 110, 90, 160, "74AHCT125 at 5 V")
    drawing.box(1030, 110, 150, 230, "DM542T (q1)")
    rows = [
        (140, f"{pins.step['q1']} STEP q1", "PUL+"),
        (185, f"{pins.dir['q1']} DIR q1", "DIR+"),
        (230, f"{pins.enable} ENABLE", "ENA+"),
    ]
    for y, pin, terminal in rows:
        _right_pin(drawing, y, pin)
        drawing.wire((BOARD_RIGHT, y), (850, y))
        drawing.wire((940, y), (1030, y))
        drawing.elements.append(f'<path d="M 880 {y - 12} L 880 {y + 12} L 908 {y} Z" fill="white" stroke="{SIGNAL}"/>')
        drawing.wire((850, y), (880, y))
        drawing.wire((908, y), (940, y))
        drawing.text(1038, y + 4.5, terminal)
    drawing.dot(790, 230)
    drawing.wire((790, 230), (790, 330))
    drawing.resistor(790, 265, "10 k", upright=True)
    drawing.wire((790, 300), (812, 300))
    drawing.elements.pop()
    drawing.flag(790, 330, "3.3 V", POWER)
    drawing.dot(765, 230)
    drawing.wire((765, 230), (765, 365))
    drawing.flag(765, 365, "EN", SIGNAL)
    _terminal(drawing, 1030, 290, "PUL- DIR- ENA-", "GND", GROUND)
    _terminal(drawing, 1030, 320, "+V", "24 V S", POWER)
    _motor(drawing, 1180, 185, "NEMA23", "PG47")


def _terminal(drawing: Drawing, x: float, y: float, name: str, net: str, color: str) -> None:
    drawing.text(x + 8, y + 4.5, name)
    drawing.wire((x, y), (x - 20, y), color=color)
    drawing.flag(x - 20, y, net, color, to_left=True)


def _motor(drawing: Drawing, x: float, y: float, first: str, second: str) -> None:
    for offset in (-24, -8, 8, 24):
        drawing.wire((x, y + offset), (x + 62, y + offset), color=INK)
    drawing.elements.append(f'<circle cx="{x + 100}" cy="{y}" r="44" fill="#f4f6f8" stroke="{INK}"/>')
    drawing.text(x + 100, y, first, "middle")
    drawing.text(x + 100, y + 17, second, "middle")


def _small_driver(drawing: Drawing, pins: Pins, joint: str, top: float) -> None:
    drawing.box(1030, top, 150, 150, f"A4988 ({joint})")
    for offset, signal, pin in ((20, "STEP", pins.step[joint]), (45, "DIR", pins.dir[joint])):
        _right_pin(drawing, top + offset, f"{pin} {signal} {joint}")
        drawing.wire((BOARD_RIGHT, top + offset), (1030, top + offset))
        drawing.text(1038, top + offset + 4.5, signal)
    _terminal(drawing, 1030, top + 75, "EN", "EN", SIGNAL)
    _terminal(drawing, 1030, top + 101, "VDD RST-SLP", "3.3 V", POWER)
    _terminal(drawing, 1030, top + 127, "GND GND", "GND", GROUND)
    drawing.wire((1180, top + 127), (1215, top + 127), color=POWER)
    drawing.text(1172, top + 127 + 4.5, "VMOT", "end")
    drawing.flag(1215, top + 127, "24 V S", POWER)
    drawing.dot(1196, top + 127, POWER)
    drawing.wire((1196, top + 127), (1196, top + 139), color=POWER)
    drawing.wire((1184, top + 139), (1208, top + 139), color=INK)
    drawing.wire((1184, top + 145), (1208, top + 145), color=INK)
    drawing.wire((1196, top + 145), (1196, top + 160), color=GROUND)
    drawing.flag(1196, top + 160, "GND", GROUND)
    drawing.text(1250, top + 164.5, "100 uF")
    _motor(drawing, 1180, top + 50, "NEMA17", joint)


def _power(drawing: Drawing) -> None:
    drawing.text(30, 792, "Motor power: the e-stop cuts it without the ESP32", bold=True)
    drawing.box(60, 830, 130, 120, "supply 24 V")
    drawing.text(182, 864.5, "+", "end")
    drawing.text(182, 929.5, "-", "end")
    drawing.wire((190, 860), (250, 860), color=POWER)
    drawing.resistor(270, 860, "fuse")
    drawing.wire((290, 860), (640, 860), color=POWER)
    drawing.dot(330, 860, POWER)
    drawing.wire((330, 860), (330, 905), (380, 905), color=SAFETY)
    drawing.closed_contact(380, 905, SAFETY)
    drawing.text(405, 932, "e-stop, contact 1 (NC)", "middle")
    drawing.wire((430, 905), (545, 905), color=SAFETY)
    drawing.elements.append(f'<rect x="545" y="890" width="50" height="30" fill="white" stroke="{INK}"/>')
    drawing.text(570, 909.5, "K1", "middle")
    drawing.text(570, 937, "coil", "middle")
    drawing.wire((595, 905), (630, 905), color=GROUND)
    drawing.flag(630, 905, "GND", GROUND)
    drawing.wire((640, 860), (678, 843), color=POWER)
    drawing.wire((684, 860), (760, 860), color=POWER)
    drawing.text(662, 832, "K1, contact (NO)", "middle")
    drawing.flag(760, 860, "24 V S", POWER)
    drawing.text(860, 864.5, "switched: DM542T and both A4988")
    drawing.wire((190, 925), (225, 925), color=GROUND)
    drawing.flag(225, 925, "GND", GROUND)
    drawing.text(860, 897, "The ESP32 keeps its own 5 V (USB, or a converter from the")
    drawing.text(860, 917, "unswitched 24 V): it must tell that the e-stop was pressed.")
    drawing.text(30, 990, "NC: opens when pressed. NO: closes when energised. All grounds meet at the supply's minus.")


def main() -> None:
    """Write wiring.svg."""
    PICTURE.write_text(draw(read_pins()).svg())


if __name__ == "__main__":
    main()
