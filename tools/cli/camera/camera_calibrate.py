"""`gemelo camera calibrate`: the lens of a camera, from shots of a printed chess board."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from gemelo.libraries.vision.boards import ChessBoard, Sighting
from gemelo.libraries.vision.calibration.lens import FEWEST_SHOTS, LensFit, fit_lens
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.other_boards import other_board
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.cell import Calibration
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.camera.camera_boards import bar_option, chess_board
from gemelo.tools.cli.camera.camera_images import from_bus, from_folder, subject
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
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
            print(sentence(because("camera.calibrate.hold")))
            shots = take(from_bus(session, camera.name), board, width, height, options.shots)
    fit = _fit(shots, width, height)
    for index in fit.outliers:
        print(sentence(because("camera.calibrate.left_out", shot=index + 1, off=fit.errors[index])))
    if not fit.is_accepted:
        raise CommandError(because("camera.calibrate.unknown", *fit.faults))
    lens = Calibration(
        size=(width, height),
        intrinsics=tuple(float(value) for value in fit.model.matrix.ravel()),
        distortion=tuple(float(value) for value in fit.model.distortion),
        held_out=fit.held_out, focal_sigma=fit.focal_sigma, date=datetime.now(UTC).strftime("%Y-%m-%d"),
    )  # fmt: skip
    path = camera.write(calibration=lens)
    print(sentence(because("camera.calibrate.done", _figures(fit), camera=camera.name, count=len(shots))))
    print(sentence(because("camera.written", file=str(path))))
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
        self._printed: list[Reason] = []

    def look(self, image: GreyImage) -> None:
        """Takes some tenths of a second."""
        other = other_board(image, self._board)
        if other is not None and other not in self._printed:
            self._printed.append(other)
            print(sentence(other), flush=True)


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
                print(sentence(because("camera.calibrate.shot", shot=len(kept))), flush=True)
                continue
            fit = fit_lens(kept, width, height)
            advice = fit.advice[0] if fit.advice else because("camera.calibrate.enough")
            print(sentence(because("camera.calibrate.shot.fit", _figures(fit), advice, shot=len(kept))), flush=True)
            if len(kept) >= most or (fit.is_accepted and not fit.advice):
                break
    except KeyboardInterrupt:
        print()
    return kept


def _fit(shots: list[Sighting], width: int, height: int) -> LensFit:
    try:
        return fit_lens(shots, width, height)
    except NotMeasured as error:
        raise CommandError(because("camera.nothing_written", error.reason)) from error


def _apart(first: Sighting, second: Sighting) -> float:
    """[px] between the points that both show; without any they are far apart."""
    pixels = {tuple(np.round(point, 6)): pixel for point, pixel in zip(first.points, first.pixels, strict=True)}
    both = [
        float(np.linalg.norm(pixel - pixels[key]))
        for point, pixel in zip(second.points, second.pixels, strict=True)
        if (key := tuple(np.round(point, 6))) in pixels
    ]
    return float(np.mean(both)) if both else float("inf")


def _figures(fit: LensFit) -> Reason:
    focal = float(fit.model.matrix[0, 0])
    return because("camera.calibrate.figures", focal=focal, sigma=fit.focal_sigma, off=fit.held_out)
