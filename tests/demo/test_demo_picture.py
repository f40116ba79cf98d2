"""A machine that cannot draw without a display runs the demonstration, and says why there is no picture."""

from __future__ import annotations

from pathlib import Path

import pytest
import rerun

from gemelo.services.visualizer.program import screenshot
from gemelo.tools.demo import main
from tests.optional import lack

LACK = "Vulkan missing: sudo apt-get install mesa-vulkan-drivers"


def test_what_is_missing_to_draw_is_what_the_tests_ask_for_too() -> None:
    assert main.missing_driver() == lack("vulkan")
    assert main.missing_driver() in ("", LACK)


def test_without_a_driver_the_picture_is_left_out_with_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(main, "missing_driver", lambda: LACK)
    assert main.take_picture(tmp_path / "none.rrd", tmp_path / "none.png") == []
    assert capsys.readouterr().out == f"demo: no picture of the view: {LACK}\n"


def test_with_a_driver_a_picture_that_cannot_be_taken_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(main, "missing_driver", str)
    (complaint,) = main.take_picture(tmp_path / "none.rrd", tmp_path / "none.png")
    assert str(complaint).startswith("no picture: there is no recording")


def test_a_viewer_that_finds_nothing_that_draws_leaves_the_picture_out_with_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The driver's file is there, and does not work: what the viewer says on a machine without Vulkan's own library."""
    monkeypatch.setattr(main, "missing_driver", str)
    panicked = (
        "thread 'main' panicked at 'Failed to get render context'\nre_viewer/src/app/mod.rs:1425\nstack backtrace:"
    )
    viewer = tmp_path / "rerun"
    viewer.write_text(f'#!/bin/sh\ncat >&2 <<"END"\n{panicked}\nEND\nexit 134\n')
    viewer.chmod(0o755)
    monkeypatch.setattr(screenshot, "rerun_binary", lambda: viewer)
    recording = tmp_path / "demo.rrd"
    recording.touch()
    assert main.take_picture(recording, tmp_path / "none.png") == []
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("demo: no picture of the view: no Vulkan driver draws here")
    assert "sudo apt-get install mesa-vulkan-drivers" in line


@pytest.mark.full
def test_the_real_viewer_without_vulkan_draws_or_is_left_out_and_fails_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for variable in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(variable, str(tmp_path / "none.json"))
    recording = tmp_path / "demo.rrd"
    stream = rerun.RecordingStream("demo")
    stream.save(recording)
    stream.log("point", rerun.Points3D([[0.0, 0.0, 0.0]]))
    stream.flush()
    assert main.take_picture(recording, tmp_path / "demo.png") == []
    lines = capsys.readouterr().out.splitlines()
    assert (tmp_path / "demo.png").is_file() != (len(lines) == 1)
