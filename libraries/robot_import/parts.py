"""Common motors and drivers with the source of each figure: the defaults of what a URDF cannot say.

The timings of A4988 and DRV8825 are those that RepRapFirmware's table of drivers gives, those of the TMC2209 stand in
section 13.1 of its datasheet; copies of a part may be slower: read the sheet of the one at hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from gemelo.libraries.robot_import.questions import BadAnswer
from gemelo.schemas.reasons import because

T = TypeVar("T")


@dataclass(frozen=True)
class MotorPart:
    """A stepper, as its maker describes it."""

    name: str
    full_steps: int  # [steps/rev] of the shaft
    ratio: str  # of a gearbox in it: motor turns per turn of its shaft
    most_rpm: float  # [rev/min] of the shaft behind that gearbox, without losing steps under a usual load
    source: str


@dataclass(frozen=True)
class DriverPart:
    """A step and direction driver, as its maker describes it."""

    name: str
    step_high_us: float
    step_low_us: float
    dir_setup_us: float
    enable_lead_ms: float
    microsteps: tuple[int, ...]
    usual: int  # microsteps that it is mostly set to
    source: str


MOTORS = (
    MotorPart("NEMA 17", 200, "1", 300.0,
              "1.8 degrees a step: NEMA ICS 16 frame and makers' sheets (as 17HS4401); 300 RPM: chosen, where the "
              "pull-out curves of such motors at 24 V begin to fall"),
    MotorPart("NEMA 23", 200, "1", 300.0,
              "1.8 degrees a step: NEMA ICS 16 frame and makers' sheets (as 23HS22); 300 RPM: chosen, where the "
              "pull-out curves of such motors at 24 V begin to fall"),
    MotorPart("28BYJ-48", 32, "25792/405", 10.0,
              "32 full steps a turn (5.625 degrees / 64 in half steps) and a gearbox nominally 1/64: maker's sheet; "
              "63.684 = 32/9 x 22/11 x 26/9 x 31/10 by counting its teeth; 10 RPM: chosen between the sheet's idle "
              "in-traction and out-traction rates (600 and 1000 half steps/s are 8.8 and 14.7 RPM). Unipolar: cut "
              "its centre tap for a step and direction driver"),
)  # fmt: skip
DRIVERS = (
    DriverPart("A4988", 1.0, 1.0, 0.2, 1.0, (1, 2, 4, 8, 16), 16,
               "Allegro A4988 datasheet, figure 1 (1 us high, 1 us low, 200 ns set-up) and the text on SLEEP (1 ms)"),
    DriverPart("DRV8825", 1.9, 1.9, 0.65, 1.7, (1, 2, 4, 8, 16, 32), 32,
               "TI DRV8825 datasheet (SLVSA73), timing: 1.9 us high and low, 650 ns set-up, 1.7 ms to wake"),
    DriverPart("TMC2209", 0.2, 0.2, 0.1, 1.0, (8, 16, 32, 64), 16,
               "Trinamic TMC2209 datasheet, STEP/DIR timing: 100 ns high and low, 20 ns set-up, here with room for "
               "their input filter; microsteps by its pins MS1 and MS2"),
    DriverPart("DM542", 2.5, 2.5, 5.0, 200.0, (2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128), 8,
               "Leadshine DM542 manual: pulses of 2.5 us, direction 5 us ahead, 200 ms after enabling"),
)  # fmt: skip
# GPIOs of an ESP32 that are free for outputs and have no say in how it boots, by pairs of step and direction.
PINS = ((25, 27), (18, 19), (22, 23), (16, 17), (32, 33), (14, 26), (4, 13), (5, 21))
SWITCH_PINS = (34, 35, 36, 39, 15, 2, 12, 0)  # the first four can only read
USUAL_DRIVER = "TMC2209"


def motor_named(text: str) -> MotorPart:
    """By its name however it is written ("nema17"); raises `BadAnswer` with all names."""
    return _named(text, {part.name: part for part in MOTORS}, "import.answer.motor")


def driver_named(text: str) -> DriverPart:
    """By its name however it is written; raises `BadAnswer` with all names."""
    return _named(text, {part.name: part for part in DRIVERS}, "import.answer.driver")


def _named(text: str, parts: dict[str, T], code: str) -> T:
    wanted = _plain(text)
    for name, part in parts.items():
        if _plain(name) == wanted:
            return part
    raise BadAnswer(because(code, text=text, names=tuple(parts)))


def _plain(text: str) -> str:
    return "".join(letter for letter in text.lower() if letter.isalnum())
