"""The direction of the jaws, which decides what is attached and what is released; and the values of an opening."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo import BadArgument
from gemelo.api.gripping import opening_of, opens
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.grippers.kinds import Gripper


@pytest.fixture
def gripper() -> Gripper:
    found = load_arm(Path(__file__).parents[2] / "urdf" / "parol6").gripper
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("known", "before", "to", "is_opening"),
    [
        (True, 0.0, 0.04, True),
        (True, 0.04, 0.0, False),
        (True, 0.0, 0.0, False),  # closed again on what it holds: that stays held
        (True, 0.04, 0.04, False),
        (True, 0.02, 0.03, True),
        (True, 0.0195, 0.02, False),  # less than the tolerance
        (False, 0.0, 0.0, False),
        (False, 0.0, 0.04, True),
    ],
)
def test_jaws_open_where_they_go_apart(
    gripper: Gripper, known: bool, before: float, to: float, is_opening: bool
) -> None:
    assert opens(gripper, GripperState(known=known, position=before), to) is is_opening


def test_words_and_lengths_are_openings(gripper: Gripper) -> None:
    assert opening_of(gripper, "open") == gripper.open
    assert opening_of(gripper, "close") == gripper.closed
    assert opening_of(gripper, 0.025) == 0.025


@pytest.mark.parametrize(
    ("to", "words"),
    [
        ("shut", 'neither "open" nor "close"'),
        (25, "25 mm is 0.025"),
        (-0.01, "is not 0 to 0.04 m"),
        (float("nan"), "finite"),
        (True, "grip"),
    ],
)
def test_what_is_no_opening_is_refused_with_what_is(gripper: Gripper, to: str | float, words: str) -> None:
    with pytest.raises(BadArgument, match=words):
        opening_of(gripper, to)
