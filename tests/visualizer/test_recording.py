"""Data sent to the viewer can be read back from a recording, and opens as a picture that is not blank."""

import subprocess

import numpy as np
import pytest
from PIL import Image

from gemelo.schemas.reasons import because
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.program import screenshot
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.services.visualizer.program.screenshot import NoPicture, save_screenshot
from tests.optional import need


@pytest.fixture(scope="module")
def printed(recording):
    """The recording as the rerun program prints it."""
    done = subprocess.run([rerun_binary(), "rrd", "print", recording], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize(
    "entity",
    [
        entities.MODE, entities.PANEL, entities.LOG, entities.PATH, entities.TRAIL,
        entities.commanded("brazo_joint"), entities.executed("efector_joint"), entities.error("antebrazo_joint"),
        entities.shaft("antebrazo_joint"),
        f"{entities.MEASURED}/base_link/brazo_link/antebrazo_link/efector_link",
        f"{entities.COMMANDED}/base_link/brazo_link/visual_0",
    ],
)  # fmt: skip
def test_everything_a_person_looks_at_is_in_the_recording(printed, entity):
    assert f"/{entity}" in printed


def test_the_layout_travels_with_the_recording(recording):
    done = subprocess.run(
        [rerun_binary(), "rrd", "print", "-v", recording], capture_output=True, text=True, check=True
    ).stdout
    assert "viewport" in done


def test_the_picture_shows_an_arm_and_its_plots(recording, tmp_path):
    need("vulkan")
    with Image.open(save_screenshot(recording, tmp_path / "view.png", size=(960, 540))) as image:
        pixels = np.asarray(image.convert("RGB"))
    height, width, _ = pixels.shape
    assert width == 960
    arm = pixels[: height * 6 // 10, : width // 2].astype(int)
    plots = pixels[height // 10 : height * 9 // 10, width * 6 // 10 :].astype(int)
    assert arm.std() > 8.0
    orange = (plots[..., 0] > 180) & (plots[..., 1] < 180) & (plots[..., 2] < 120)
    assert orange.mean() > 0.005


def test_a_missing_recording_is_said(tmp_path):
    with pytest.raises(NoPicture, match=r"there is no recording .*none\.rrd") as refused:
        save_screenshot(tmp_path / "none.rrd", tmp_path / "view.png")
    assert refused.value.reason == because("recording.picture.none", file=str(tmp_path / "none.rrd"))


def test_a_viewer_that_ends_at_once_is_said_with_its_words(tmp_path, monkeypatch):
    viewer = tmp_path / "rerun"
    viewer.write_text("#!/bin/sh\necho 'Error: no room' >&2\nexit 1\n")
    viewer.chmod(0o755)
    monkeypatch.setattr(screenshot, "rerun_binary", lambda: viewer)
    (tmp_path / "a.rrd").touch()
    with pytest.raises(NoPicture) as refused:
        save_screenshot(tmp_path / "a.rrd", tmp_path / "view.png")
    assert refused.value.reason == because(
        "recording.picture.failed", because("recording.picture.not_started"), file=str(tmp_path / "a.rrd"),
        text="Error: no room",
    )  # fmt: skip


def test_a_broken_recording_is_said_with_the_viewers_words(tmp_path):
    need("vulkan")
    (tmp_path / "broken.rrd").write_bytes(b"not a recording")
    with pytest.raises(RuntimeError, match=r"no picture of .*broken\.rrd"):
        save_screenshot(tmp_path / "broken.rrd", tmp_path / "view.png", timeout=4.0)
