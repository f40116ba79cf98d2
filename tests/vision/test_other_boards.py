"""Another board before the camera is named: the commands say what they see, beside what they want."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gemelo.libraries.vision.boards import picture
from gemelo.libraries.vision.other_boards import command_of, other_board
from gemelo.schemas.reasons import because
from gemelo.tools.cli.camera.camera_boards import CHESS_BOARD, TAG_BOARD

PAPER = 255


def paper(drawn: np.ndarray, margin: int = 60) -> np.ndarray:
    return cv2.copyMakeBorder(drawn, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=PAPER)


def chessboard(columns: int, rows: int, edge: int = 50) -> np.ndarray:
    """Of so many squares."""
    rows_of = np.add.outer(np.arange(rows), np.arange(columns)) % 2
    return paper(np.kron(rows_of, np.ones((edge, edge))).astype(np.uint8) * PAPER)


def tags(dictionary: str, *ids: int, size: int = 90) -> np.ndarray:
    made = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return np.hstack([paper(cv2.aruco.generateImageMarker(made, number, size), 40) for number in ids])


def charuco(dictionary: str, columns: int = 7, rows: int = 5) -> np.ndarray:
    made = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return paper(cv2.aruco.CharucoBoard((columns, rows), 0.04, 0.03, made).generateImage((700, 500)))


@pytest.mark.parametrize("board", [CHESS_BOARD, TAG_BOARD])
@pytest.mark.parametrize(
    ("image", "said"),
    [
        (chessboard(8, 6), "a chessboard without tags (7 x 5 inner corners)"),
        (chessboard(10, 7), "a chessboard without tags (9 x 6 inner corners)"),
        (tags("DICT_4X4_50", 0, 1, 2), "tags of DICT_4X4_50, numbers 0, 1, 2"),
        (tags("DICT_4X4_50", 7), "tags of DICT_4X4_50, number 7"),
        (tags("DICT_6X6_250", 3, 200), "tags of DICT_6X6_250, numbers 3, 200"),
        (tags("DICT_7X7_50", 1, 2), "tags of DICT_7X7_50, numbers 1, 2"),
        (tags("DICT_APRILTAG_25h9", 1, 2), "tags of DICT_APRILTAG_25h9, numbers 1, 2"),
        (charuco("DICT_4X4_50"), "tags of DICT_4X4_50"),
        (charuco("DICT_6X6_250"), "tags of DICT_6X6_50"),
        (np.full((400, 600), PAPER, np.uint8), ""),
        (np.random.default_rng(1).integers(0, 255, (400, 600)).astype(np.uint8), ""),
    ],
)
def test_what_is_seen_is_named(image, said, board):
    found = other_board(image, board)
    assert (found is not None) == bool(said)
    assert str(found.causes[0] if found is not None else "").startswith(said)


def test_the_board_of_the_other_command_is_said_to_be_that():
    chess = picture(CHESS_BOARD.squares(), CHESS_BOARD.size, 0.02, 3000.0)
    of_tags = picture(TAG_BOARD.squares(), TAG_BOARD.size, 0.02, 5000.0)
    for image, wanted, shown in ((chess, TAG_BOARD, "chess"), (of_tags, CHESS_BOARD, "tags")):
        found = other_board(image, wanted)
        assert found is not None
        assert (found.code, found.values) == ("measure.other_board", {"command": command_of(wanted)})
        assert found.causes[0].code == "measure.seen.tags.own"
        assert found.causes[0].values == {"command": f"gemelo camera print {shown}"}
    assert command_of(CHESS_BOARD) == "gemelo camera print chess"
    assert command_of(TAG_BOARD) == "gemelo camera print tags"


def test_tags_of_the_right_kind_with_other_numbers_are_said_with_those_that_are_wanted():
    seen = because("measure.seen.tags", family="DICT_APRILTAG_36h11", numbers="0, 1")
    others = because("measure.seen.tags.others", seen, first=200, last=208)
    found = other_board(tags("DICT_APRILTAG_36h11", 0, 1), TAG_BOARD)
    assert found == because("measure.other_board", others, command="gemelo camera print tags")
