"""Another board in the place of ours: what an image shows, by the name that a person knows it by."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from gemelo.libraries.vision.boards import ChessBoard, TagBoard
from gemelo.libraries.vision.tags import FAMILIES, GreyImage
from gemelo.schemas.reasons import Reason, because

# Of each kind of tag the smallest dictionary first: its tags are in the larger ones too. Those with few bits find tags
# where there are none, so they count from FEWEST_OF_WEAK on.
DICTIONARIES = (
    "DICT_APRILTAG_36h11", "DICT_APRILTAG_25h9", "DICT_4X4_50", "DICT_5X5_50", "DICT_5X5_100", "DICT_6X6_50",
    "DICT_6X6_250", "DICT_7X7_50", "DICT_ARUCO_MIP_36h12", "DICT_APRILTAG_36h10", "DICT_4X4_100", "DICT_4X4_250",
    "DICT_4X4_1000", "DICT_5X5_250", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_250", "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_16h5",
)  # fmt: skip
WEAK = ("DICT_4X4_1000", "DICT_APRILTAG_16h5", "DICT_ARUCO_ORIGINAL")
FEWEST_OF_WEAK = 4
MOST_NAMED = 6  # ids
SMALLEST = (3, 3)  # inner corners of a chessboard
FEWEST_CORNERS = 12  # the modules of a tag are a chessboard of 3 x 3
CIRCLES = ((4, 11), (11, 4), (4, 5), (7, 6), (5, 4), (6, 7))  # grids of circles in tutorials


def other_board(image: GreyImage, wanted: ChessBoard | TagBoard) -> Reason | None:
    """What is seen that is not `wanted`, as a chessboard without tags, and what to print; None for nothing."""
    seen = _seen(image, wanted)
    return None if seen is None else because("measure.other_board", seen, command=command_of(wanted))


def command_of(wanted: ChessBoard | TagBoard) -> str:
    """What prints the board that is wanted."""
    return f"gemelo camera print {'chess' if isinstance(wanted, ChessBoard) else 'tags'}"


def _seen(image: GreyImage, wanted: ChessBoard | TagBoard) -> Reason | None:
    name, ids = _tags(image)
    if name:
        return _meant(_tags_seen(name, ids), name, ids, wanted)
    if (corners := _chessboard(image)) is not None:
        return because("measure.seen.chess", columns=corners[0], rows=corners[1])
    if cv2.QRCodeDetector().detectAndDecode(image)[0]:
        return because("measure.seen.qr")
    if any(cv2.findCirclesGrid(image, size, flags=_grid(size))[0] for size in CIRCLES):
        return because("measure.seen.circles")
    return None


def _tags(image: GreyImage) -> tuple[str, list[int]]:
    """The dictionary of which most tags are seen, the first of several, and their ids."""
    best: tuple[str, list[int]] = ("", [])
    for name in DICTIONARIES:
        ids = _detector(name).detectMarkers(image)[1]
        found = [] if ids is None else sorted(int(number) for number in np.ravel(ids))
        if len(found) > len(best[1]) and (name not in WEAK or len(found) >= FEWEST_OF_WEAK):
            best = (name, found)
    return best


@cache
def _detector(name: str) -> cv2.aruco.ArucoDetector:
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name)))


def _chessboard(image: GreyImage) -> tuple[int, int] | None:
    """The numbers of inner corners along its sides, the larger first, of a chessboard of whatever size."""
    found, _, meta = cv2.findChessboardCornersSBWithMeta(
        image, SMALLEST, flags=cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    )
    if not found or meta.size < FEWEST_CORNERS:
        return None
    return max(meta.shape), min(meta.shape)


def _grid(size: tuple[int, int]) -> int:
    return cv2.CALIB_CB_ASYMMETRIC_GRID if 11 in size else cv2.CALIB_CB_SYMMETRIC_GRID


def _tags_seen(name: str, ids: list[int]) -> Reason:
    if len(ids) == 1:
        return because("measure.seen.tag", family=name, number=ids[0])
    return because("measure.seen.tags", family=name, numbers=_numbers(ids))


def _numbers(ids: list[int]) -> str:
    """The first of them, and by +3 how many more there are."""
    more = f", +{len(ids) - MOST_NAMED}" if len(ids) > MOST_NAMED else ""
    return f"{', '.join(map(str, ids[:MOST_NAMED]))}{more}"


def _meant(tags: Reason, name: str, ids: list[int], wanted: ChessBoard | TagBoard) -> Reason:
    """A word on a board of ours for another command, and on one of the wanted kind with other numbers."""
    if isinstance(wanted, ChessBoard):
        own = because("measure.seen.tags.own", tags, command="gemelo camera print tags")
        return own if _is_of_tags(name, ids) else tags
    if name == "DICT_5X5_50" or name == "DICT_5X5_100":
        return because("measure.seen.tags.own", tags, command="gemelo camera print chess")
    if getattr(cv2.aruco, name) == FAMILIES[wanted.family][0]:
        last = wanted.first + wanted.columns * wanted.rows - 1
        return because("measure.seen.tags.others", tags, first=wanted.first, last=last)
    return tags


def _is_of_tags(name: str, ids: list[int]) -> bool:
    """True for tags as those of the board for a camera's mount: from 200 on, of its family."""
    return name == "DICT_APRILTAG_36h11" and ids[0] >= 200
