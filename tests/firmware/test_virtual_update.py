"""An update over MQTT: a virtual ESP32 as a process, a real mosquitto, and the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bed_firmware import Bed, wait_for
from update_bed import NEWER, an_image

from gemelo.firmware.platform.host.flash import Flash, NetworkCredentials
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.libraries.runtime.signatures import make_key
from gemelo.schemas.device import DeviceCommandKind
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

pytestmark = pytest.mark.full


def test_a_board_is_updated_over_mqtt_disarmed_only_and_is_armed_again_after_it(
    bed: Bed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    key, file = tmp_path / "update.key", tmp_path / "firmware.bin"
    make_key(key, key.with_suffix(".pub"))
    file.write_bytes(an_image())
    (tmp_path / "run").mkdir()
    flash = Flash(tmp_path / "run/virtual_esp32_flash.json", "rm1", UnwrittenFiles(print))
    flash.keep_credentials(NetworkCredentials(update_key=key.with_suffix(".pub").read_text()))
    bed.start_device()
    monkeypatch.setenv("GEMELO_MQTT_PORT", str(bed.port))
    words = ["device", "update", str(file), "--key", str(key)]
    assert run(words) is ExitCode.FAILED
    assert "the device is armed: `gemelo device disarm` first" in capsys.readouterr().err
    assert bed.order(DeviceCommandKind.DISARM) == 0
    assert run(words) is ExitCode.OK
    assert f"it runs firmware {NEWER} from ota_1" in capsys.readouterr().out
    wait_for(lambda: bed.status.get("slot") == "ota_1", "the status of the new firmware")  # after the last will
    assert (bed.status["firmware"], bed.status["slot"], bed.status["reset_cause"]) == (NEWER, "ota_1", "update")
    assert json.loads((tmp_path / "run/virtual_esp32_ota.json").read_text()) == {"slot": 1, "state": "valid"}
    assert bed.order(DeviceCommandKind.ARM) == 0
    assert "the new firmware has said status, and stays" in bed.log
