"""`gemelo grip`: what its words mean, and what is refused before the stack is asked."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

import gemelo
from gemelo import Gripped
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.main import parse
from gemelo.tools.cli.motion import grip
from gemelo.tools.cli.motion.grip import opening


def said(to: str) -> CommandError:
    """What it says; nothing has been asked of any stack."""
    options = parse(["grip", to])
    with pytest.raises(CommandError) as refused:
        options.command.load("run")(options)
    return refused.value


@pytest.mark.parametrize(
    ("text", "meant"), [("open", "open"), ("close", "close"), ("25mm", 0.025), ("0.01", 0.01), ("0", 0.0)]
)
def test_words_and_lengths_are_openings(text: str, meant: str | float) -> None:
    assert opening(text) == pytest.approx(meant) if isinstance(meant, float) else opening(text) == meant


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("25", "25 without a unit is in m, and more than 10 m: did you mean 25mm"),
        ("0.06", "an opening of 60mm is not 0mm to 50mm between the jaws"),
        ("51mm", "an opening of 51mm is not 0mm to 50mm between the jaws"),
        ("shut", '"shut" is not a length'),
        ("30deg", "must be in m or mm"),
        ("nan", '"nan" is not a length'),
        ("1e400", "is not finite"),
    ],
)
def test_an_opening_that_cannot_be_is_refused_with_what_can(text: str, words: str) -> None:
    assert words in str(said(text))


def test_a_robot_without_a_gripper_says_what_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    bare = replace(gemelo.load_robot("rm1").description, gripper=None)
    monkeypatch.setattr(grip, "load_robot", lambda: SimpleNamespace(description=bare))
    assert "rm1 has no gripper: write a [gripper] into its robot.toml" in str(said("open"))


def test_how_it_ended_is_one_line() -> None:
    stalled = Gripped(0.0203, 11.0, False, True, True, "cup", "")
    assert str(stalled) == "20.3 mm, stopped by what is between the jaws, holds cup"
    commanded = Gripped(0.04, 0.0, True, False, False, "", "cup")
    assert str(commanded) == "40.0 mm, there (commanded, not measured), has let go of cup"
