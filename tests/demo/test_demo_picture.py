"""A machine that cannot draw without a display runs the demonstration, and says why there is no picture."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.demo import main
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
    assert complaint.startswith("no picture: there is no recording")
