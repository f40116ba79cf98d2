"""`gemelo chaos` and `gemelo soak`: each becomes a program of its own, which starts a stack of its own."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

from gemelo.schemas.plain_text import ENGLISH, known
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import language
from gemelo.tools.cli.parser import Options

BROKERS = ("embedded", "mosquitto")
BROKER_HELP = "[mosquitto where it is installed, else the embedded one]"


def add_chaos_options(parser: ArgumentParser) -> None:
    """How long, which faults, which chance."""
    parser.add_argument("--minutes", type=float, default=10.0, help="how long, from when all is ready")
    parser.add_argument("--seed", type=int, default=None, help="of the order and of all chance; else a new one")
    parser.add_argument("--episode", type=int, default=None, metavar="N", help="only this one of the seed")
    parser.add_argument("--only", nargs="+", default=[], metavar="FAULT", help="only faults whose names contain this")
    parser.add_argument("--broker", choices=BROKERS, default=None, help=BROKER_HELP)
    parser.add_argument("--out", type=Path, default=Path("out/chaos"), help="folder of the results")
    parser.add_argument("--list", action="store_true", help="what there is")


def add_soak_options(parser: ArgumentParser) -> None:
    """How long, and which moves."""
    parser.add_argument("--hours", type=float, default=1.0, help="how long")
    parser.add_argument("--seed", type=int, default=1, help="of the moves")
    parser.add_argument("--broker", choices=BROKERS, default=None, help=BROKER_HELP)
    parser.add_argument("--out", type=Path, default=Path("out/soak"), help="folder of the results")


def language_option(parser: ArgumentParser) -> None:
    """Of the programs themselves: the command line has it before the command."""
    parser.add_argument("--lang", choices=known(), default=ENGLISH, help="the language of what is printed")


def run_chaos(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.tools.chaos` with the same options."""
    _become("gemelo.tools.chaos", options)


def run_soak(options: Options) -> ExitCode:
    """Becomes `python -m gemelo.tools.chaos.soak` with the same options."""
    _become("gemelo.tools.chaos.soak", options)


def _become(program: str, options: Options) -> NoReturn:
    """Raises `CommandError` where the project is installed without its own tests' tools."""
    if find_spec("gemelo.tools.chaos") is None:
        raise CommandError(because("cli.checkout", command=options.command.words[0]))
    os.execv(sys.executable, [sys.executable, "-m", program, "--lang", language(), *options.behind])
