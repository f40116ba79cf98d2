"""The boards that are printed for cameras: `gemelo camera print`, and what the other commands are told of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gemelo.libraries.vision.boards import ChessBoard, Scale, TagBoard
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.pages import PAGES, page_of
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import ExitCode, require_folder, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.units import LENGTH, parse_quantity
from gemelo.tools.cli.parser import Options, Parser

CHESS, TAGS = "chess", "tags"
TITLE = "for {}; keep it flat"  # on the page, whose font has ASCII alone
FIRST_TAG = 200  # of the board with tags: above those that a cell has on things and places
CHESS_BOARD, TAG_BOARD = ChessBoard(), TagBoard(first=FIRST_TAG)


def print_options(parser: Parser) -> None:
    """Adds which board, the page and the file."""
    parser.add_argument("board", metavar="BOARD", choices=(CHESS, TAGS), help="chess for the lens, tags for the mount")
    parser.add_argument("--page", choices=tuple(PAGES), default="a4", help="paper (a4)")
    parser.add_argument("--to", metavar="FILE", default="", help="the PDF; board_<name>.pdf here if left out")


def bar_option(parser: Parser) -> None:
    """Adds what the bar on the printed page measures."""
    said = "what the bar of 100 mm on the printed page measures, as 99.4mm: the printer's scale"
    parser.add_argument("--bar", metavar="LENGTH", default="100mm", help=said)


def run_print(options: Options) -> ExitCode:
    """Writes the page."""
    board: ChessBoard | TagBoard = CHESS_BOARD if options.board == CHESS else TAG_BOARD
    use = "gemelo camera calibrate" if options.board == CHESS else "gemelo camera mount"
    path = Path(options.to or f"board_{options.board}.pdf")
    require_folder(path.parent, f"--to {path}")
    try:
        path.write_bytes(page_of(board.squares(), board.size, TITLE.format(use), options.page))
    except NotMeasured as error:
        raise usage(because("camera.print.page", error.reason, file=str(path))) from error
    except OSError as error:
        raise usage(because("cli.file.unwritable", file=str(path), error=str(error.strerror or error))) from error
    width, height = (1e3 * edge for edge in board.size)
    print(sentence(because("camera.print.done", file=str(path), width=width, height=height, command=use)))
    return ExitCode.OK


def chess_board(bar: str) -> ChessBoard:
    """The chess board as it was printed; raises `CommandError`."""
    scale = _scale(bar)
    return replace(CHESS_BOARD, edge=scale.of(CHESS_BOARD.edge), marker=scale.of(CHESS_BOARD.marker))


def tag_board(bar: str) -> TagBoard:
    """The board with tags as it was printed; raises `CommandError`."""
    scale = _scale(bar)
    return replace(TAG_BOARD, tag=scale.of(TAG_BOARD.tag), pitch=scale.of(TAG_BOARD.pitch))


def _scale(bar: str) -> Scale:
    try:
        return Scale(parse_quantity(bar, LENGTH, "--bar"))
    except NotMeasured as error:
        raise usage(because("camera.bar", error.reason)) from error
