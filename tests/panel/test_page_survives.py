"""The page survives every process that dies in the middle of its move, and leads the next move."""

from __future__ import annotations

from math import degrees

import pytest

import gemelo
from gemelo.tools.bench.bare_browser import bare_browser
from gemelo.tools.stack.stack import Stack
from tests.panel.person import until
from tests.simulated import make_ready

ARM = "brazo_joint"
VICTIMS = ("router", "broker", "planner", "state_publisher", "stepper_gateway", "virtual_esp32")


@pytest.mark.parametrize("victim", VICTIMS)
def test_the_page_goes_on_when_a_process_is_killed_in_the_middle_of_its_move(
    arm: gemelo.Arm, twin: Stack, victim: str
) -> None:
    page = twin.pids()["panel"]
    with bare_browser(f"127.0.0.1:{twin.deployment['GEMELO_PANEL_PORT']}", lambda said, at: None) as browser:
        browser.slide(ARM, 120.0)
        browser.press("Plan and execute")
        until(lambda: abs(arm.velocities[ARM]), lambda speed: speed > 0.1, said=lambda: browser.texts)
        twin.kill(victim)
        until(lambda: victim in twin.pids(), bool)
        twin.wait_ready(120.0)
        until(lambda: arm.velocities[ARM], lambda speed: speed == 0.0)
        make_ready(arm)
        browser.slide(ARM, -20.0)
        browser.press("Plan and execute")
        until(lambda: degrees(arm.joints[ARM]), lambda now: abs(now + 20.0) < 0.06, said=lambda: browser.texts)
    assert twin.pids()["panel"] == page
    assert "Traceback" not in twin.logs("panel")
