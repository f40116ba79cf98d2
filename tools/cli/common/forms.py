"""Output forms of the commands that watch: text for a person, JSON or CSV for a program; and how often they print."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from typing import Any

import msgspec

from gemelo.tools.cli.bus.field_path import leaves
from gemelo.tools.cli.bus.messages import dump
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.parser import Options, Parser, positive_integer

Form = Callable[[Any], str]  # of one value, or of a table's rows


def count_options(parser: Parser, things: str) -> None:
    """Adds --once and -n; `things` are what is counted."""
    count = parser.add_mutually_exclusive_group()
    count.add_argument("--once", dest="count", action="store_const", const=1, help="the first one only")
    count.add_argument("-n", "--count", type=positive_integer, metavar="N", help=f"end after N {things}")


def form_options(parser: Parser) -> None:
    """Adds --json and --csv."""
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="a JSON value per line, in SI units")
    form.add_argument("--csv", action="store_true", help="lines of numbers and words under a heading, in SI units")


def form_of(options: Options, text: Form) -> Form:
    """How one value after the other is printed; `text` is for a person."""
    return csv_lines() if options.csv else json_line if options.json else text


def rows_form_of(options: Options, text: Form) -> Form:
    """How one table after the other is printed, each a sequence of rows; CSV has one heading over them all."""
    return csv_rows() if options.csv else json_line if options.json else text


def print_value(value: object, as_json: bool, text: Callable[[], str]) -> ExitCode:
    """Prints what a command says once."""
    print(json_line(value) if as_json else text().removesuffix("\n"))
    return ExitCode.OK


def yaml_document(value: object) -> str:
    """The value as YAML, with the line that ends a document."""
    return f"{dump(value)}---"


def json_line(value: object) -> str:
    """The value as JSON on one line."""
    return msgspec.json.encode(value).decode()


def csv_lines() -> Form:
    """A function that gives each value as a line of CSV, the first one under a heading with the fields' paths."""
    is_first = True

    def lines(value: object) -> str:
        nonlocal is_first
        cells = list(leaves(value))
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        if is_first:
            writer.writerow([path or "value" for path, _ in cells])
            is_first = False
        writer.writerow([cell for _, cell in cells])
        return out.getvalue().rstrip("\n")

    return lines


def csv_rows() -> Form:
    """The same for sequences of rows."""
    line = csv_lines()

    def lines(rows: Sequence[object]) -> str:
        return "\n".join(line(row) for row in rows)

    return lines
