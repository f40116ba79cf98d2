"""Every script of the examples on both arms, simulated: it ends by itself and says what it shows."""

from __future__ import annotations

import re
import runpy
import time
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from tests.simulated import found_by_connect, make_ready

SHOWS = {  # what the last line of each says
    "01_move": r"the tool is at -?\d\.\d{3} -?\d\.\d{3} -?\d\.\d{3} m",
    "02_plan_and_execute": r"<Motion \w+: named='home', .*succeeded in .*>",
    "03_watch_and_cancel": r"it stands at \{.*\}",
    "04_refused": r"<Motion \w+: position=\(.*\), succeeded in .*>",
    "05_scene": r"<Motion \w+: named='ready', seed=1, succeeded in .*>",
    "06_jog": r"the tool went up \d+\.\d mm",
    "07_device": r"IDLE",
    "08_stream": r"largest step error: 0\.\d+",
    "09_pick_and_place": r"home: straight, .* 0 steps lost",
    "15_program": r"done: 6 steps, \d+\.\d s planned",
}


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def simulated(request: pytest.FixtureRequest) -> Iterator[SimulatedArm]:
    with gemelo.simulate(request.param) as arm, found_by_connect(arm):
        yield arm


@pytest.mark.parametrize("name", SHOWS)
def test_a_script_ends_by_itself_and_shows_what_it_says(
    simulated: SimulatedArm, name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_ready(simulated)
    assert simulated.wait_for(lambda: simulated.device.mode is gemelo.DeviceMode.IDLE, 20.0)
    simulated.move(named="home")  # whatever script this worker has run before
    monkeypatch.setattr(time, "sleep", simulated.sim.sleep)
    runpy.run_path(f"examples/{name}.py", run_name="__main__")
    output, errors = capsys.readouterr()
    assert errors == ""
    assert re.fullmatch(SHOWS[name], output.splitlines()[-1]), output
    assert simulated.scene.objects == {}
    assert max(abs(error) for error in simulated.step_errors.values()) <= 0.5 + 1e-9
