"""A board is told who it is over its serial line, by the command a person uses; here the virtual one at its line."""

from __future__ import annotations

import pytest

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.stack.stack import Stack
from tests.optional import need
from tests.stack.gemelo import gemelo

PASSWORD = "correct horse battery"


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    need("mosquitto")
    environment = {"GEMELO_WIRE": "serial", "GEMELO_WIFI_PASSWORD": PASSWORD}
    out = tmp_path_factory.mktemp("out")
    with Stack(broker="mosquitto", out=out, processes=("broker", "virtual_esp32"), environment=environment) as running:
        yield running


def told(stack, *words, code=ExitCode.OK):
    line = stack.run / "virtual_esp32.tty"
    return gemelo(stack, "device", "provision", "--serial", str(line), *words, code=code)


def test_the_board_takes_what_it_is_told_and_comes_back(stack):
    said = told(stack, "--device", "rm1", "--wifi-ssid", "lab", "--mqtt-uri", "mqtt://127.0.0.1:1883")
    assert "taken: device rm1, wifi_ssid lab, mqtt_uri mqtt://127.0.0.1:1883, wifi_password given" in said
    assert "it is back: rm1, firmware" in said
    assert PASSWORD not in said + stack.logs("virtual_esp32")


def test_what_the_board_cannot_use_is_refused_in_its_words(stack):
    assert "the device refused: " in told(stack, "--device", "x" * 60, code=ExitCode.FAILED)


def test_a_factory_reset_is_done_and_the_board_comes_back(stack):
    said = told(stack, "--factory-reset", "--yes")
    assert "everything forgotten" in said
    assert "it is back" in said
