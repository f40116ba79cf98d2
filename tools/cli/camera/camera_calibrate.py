"""`gemelo camera calibrate`: the lens of a camera, from shots of a printed chess board."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from gemelo.libraries.vision.boards import ChessBoard, Sighting
from gemelo.libraries.vision.calibration.lens import FEWEST_SHOTS, LensFit, fit_lens
from gemelo.libraries.vision.other_boards import other_board, remedy
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.cell import Calibration
from gemelo.tools.cli.camera.camera_boards import bar_option, chess_board
from gemelo.tools.cli.camera.camera_images import from_bus, from_folder, subject
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import connect, load_robot
from gemelo.tools.cli.parser import Options, Parser, positive_integer

MOST_SHOTS = 40
ANOTHER = 0.06  # of the image's width: how far the board's points must be from where every other shot has them
STEADY = 1.0  # [px] between two images: a board that moves more is blurred
LOOK_AROUND = 20  # images without the board from one look for another to the next


def add_options(parser: Parser) -> None:
    """Adds the camera, the printed scale, images of a folder, and how many shots."""
    parser.add_argument("camera", metavar="CAMERA", nargs="?", default="", help="of the cell file; its first one")
    bar_option(parser)
    parser.add_argument("--images", metavar="FOLDER", default="", help="shots that were taken already")
    parser.add_argument("--shots", type=positive_integer, default=MOST_SHOTS, metavar="N", help="at most (40)")


def run(options: Options) -> ExitCode:
    """Takes shots until the lens is known, and writes camera.toml; raises `CommandError` where it is not."""
    camera, board = subject(options.camera), chess_board(options.bar)
    width, height = camera.record.size
    with ExitStack() as stack:
        if options.images:
            images = from_folder(Path(options.images), camera.record.size)
            shots = found_in(images, board)
        else:
            session = stack.enter_context(connect(load_robot()))
            print("hold the board into the image, flat, at different places, tilted by 30 degrees (Ctrl-C: enough)")
            shots = take(from_bus(session, camera.name), board, width, height, options.shots)
    fit = _fit(shots, width, height)
    for index in fit.outliers:
        print(f"shot {index + 1} does not agree with the others ({fit.errors[index]:.2f} px), and was left out")
    if not fit.is_accepted:
        raise CommandError("the lens is not known well enough, and nothing was written: " + "; ".join(fit.faults))
    lens = Calibration(
        size=(width, height),
        intrinsics=tuple(float(value) for value in fit.model.matrix.ravel()),
        distortion=tuple(float(value) for value in fit.model.distortion),
        held_out=fit.held_out, focal_sigma=fit.focal_sigma, date=datetime.now(UTC).strftime("%Y-%m-%d"),
    )  # fmt: skip
    path = camera.write(calibration=lens)
    print(f"{camera.name}: {_said(fit)}, from {len(shots)} shots")
    print(f"written to {path}")
    return ExitCode.OK


def found_in(images: Iterator[GreyImage], board: ChessBoard) -> list[Sighting]:
    """The sightings in images of which the board is seen; says once of each other board that is seen."""
    shots, strangers = [], Strangers(board)
    for image in images:
        found = board.find(image)
        if found is None:
            strangers.look(image)
        else:
            shots.append(found)
    return shots


class Strangers:
    """Says what an image shows in the place of the board, each thing once."""

    def __init__(self, board: ChessBoard) -> None:
        self._board = board
        self._said: set[str] = set()

    def look(self, image: GreyImage) -> None:
        """Takes some tenths of a second."""
        other = other_board(image, self._board)
        if other and other not in self._said:
            self._said.add(other)
            print(f"the image shows {other}, and not the board of this command: {remedy(self._board)}", flush=True)


def take(images: Iterator[GreyImage], board: ChessBoard, width: int, height: int, most: int) -> list[Sighting]:
    """Shots that stand still and differ, until the lens is accepted and nothing is advised; at most `most`."""
    kept: list[Sighting] = []
    before: Sighting | None = None
    strangers, missed = Strangers(board), 0
    try:
        for image in images:
            found = board.find(image)
            missed = missed + 1 if found is None else 0
            if missed % LOOK_AROUND == 1:
                strangers.look(image)
            is_steady = found is not None and before is not None and _apart(found, before) < STEADY
            before = found
            if found is None or not is_steady or any(_apart(found, other) < ANOTHER * width for other in kept):
                continue
            kept.append(found)
            if len(kept) < FEWEST_SHOTS:
                print(f"shot {len(kept)}", flush=True)
                continue
            fit = fit_lens(kept, width, height)
            print(f"shot {len(kept)}: {_said(fit)}; {fit.advice[0] if fit.advice else 'enough'}", flush=True)
            if len(kept) >= most or (fit.is_accepted and not fit.advice):
                break
    except KeyboardInterrupt:
        print()
    return kept


def _fit(shots: list[Sighting], width: int, height: int) -> LensFit:
    try:
        return fit_lens(shots, width, height)
    except ValueError as error:
        raise CommandError(f"{error}; nothing was written") from error


def _apart(first: Sighting, second: Sighting) -> float:
    """[px] between the points that both show; without any they are far apart."""
    pixels = {tuple(np.round(point, 6)): pixel for point, pixel in zip(first.points, first.pixels, strict=True)}
    both = [
        float(np.linalg.norm(pixel - pixels[key]))
        for point, pixel in zip(second.points, second.pixels, strict=True)
        if (key := tuple(np.round(point, 6))) in pixels
    ]
    return float(np.mean(both)) if both else float("inf")


def _said(fit: LensFit) -> str:
    focal = fit.model.matrix[0, 0]
    return (
        f"focal length {focal:.1f} +-{fit.focal_sigma:.1f} px, shots that took no part are off by {fit.held_out:.2f} px"
    )
