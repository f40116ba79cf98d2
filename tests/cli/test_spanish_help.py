"""`gemelo --lang es ... --help`, and what the parser itself refuses in Spanish."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

import pytest

from gemelo.schemas.reasons.catalogue import HELP, entries, help_text
from gemelo.schemas.topics import ACTIONS, REQUESTS, TOPICS
from gemelo.tools.chaos.faults import FAULTS
from gemelo.tools.cli.commands import COMMANDS, GROUPS
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import ABOUT, EPILOG, run
from gemelo.tools.cli.parser import ONE_OF, Parser, complete
from tests.table import table

SERVICES = Path(__file__).parents[2] / "services"
DESCRIPTION = re.compile(r'Meta\([^)]*description="([^"]+)"')
SAME = {"kill -9", "SIGTERM"}  # in Spanish too


class Listed(Parser):
    """A parser that keeps the texts of its help."""

    def __init__(self) -> None:
        self.texts: set[str] = set()
        super().__init__(add_help=False)

    def add_argument(self, *names: Any, **settings: Any) -> Any:
        self.texts.add(settings.get("help", ""))
        return super().add_argument(*names, **settings)

    def add_argument_group(self, *words: Any, **settings: Any) -> Any:
        self.texts.add(settings.get("title", next(iter(words), "")))
        return self._listening(super().add_argument_group(*words, **settings))

    def add_mutually_exclusive_group(self, **settings: Any) -> Any:
        return self._listening(super().add_mutually_exclusive_group(**settings))

    def _listening(self, group: Any) -> Any:
        add, inner = group.add_argument, group.add_mutually_exclusive_group

        def listed(*names: Any, **settings: Any) -> Any:
            self.texts.add(settings.get("help", ""))
            return add(*names, **settings)

        group.add_argument = listed
        group.add_mutually_exclusive_group = lambda **settings: self._listening(inner(**settings))
        return group


def texts() -> set[str]:
    """Every text of the help that is not typed."""
    found = {ABOUT, EPILOG, *GROUPS.values(), *(command.about for command in COMMANDS)}
    for command in COMMANDS:
        parser = Listed()
        complete(parser, command)
        paragraphs = (parser.epilog or "").split("\n\n")
        found |= parser.texts | {each for each in paragraphs if not each.startswith(("example:", "examples:"))}
    return found - {"", argparse.SUPPRESS}


def of_lists() -> set[str]:
    """What the lists say of topics, requests, actions, faults of chaos, and the parameters of the processes."""
    rows = {row.about for rows in (TOPICS, REQUESTS, ACTIONS, FAULTS) for row in rows if row.about}
    return rows | {each for file in SERVICES.rglob("*.py") for each in DESCRIPTION.findall(file.read_text())}


def shown(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    with pytest.raises(SystemExit) as ended:
        run(["--lang", "es", *words])
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out + said.err


def test_what_the_help_says_is_in_the_catalogue():
    every = texts()
    missing = {each for each in every if help_text(each, "es") == each}
    assert len(every) > 350
    assert len(missing) < 0.02 * len(every), sorted(missing)


def test_what_the_lists_say_is_in_the_catalogue() -> None:
    assert [each for each in of_lists() - SAME if help_text(each, "es") == each] == []


def test_a_text_of_the_catalogue_is_one_that_is_there():
    own = {name for context, name in entries("es") if context == HELP}
    argparses = {text for text in own if ("%" in text and "(" in text) or text.startswith(("expected ", "show this"))}
    stale = own - texts() - of_lists() - argparses
    assert len(stale) < 20, sorted(stale)


def test_a_place_of_argparse_stays_in_its_translation():
    for context, name in entries("es"):
        if context == HELP:
            assert name.count("%") == help_text(name, "es").count("%"), name


def test_the_help_of_a_command_is_spanish(capsys):
    code, text = shown(["move", "--help"], capsys)
    assert code == ExitCode.OK
    assert text.startswith("uso: gemelo move [-h]")
    assert "planifica una trayectoria hasta una meta y la sigue" in text
    assert "muestra esta ayuda y termina" in text
    assert "una posición con nombre del SRDF" in text
    assert "ejemplos:\n  gemelo move --to " in text
    assert "(--to X Y Z | --joints" in text


def test_all_commands_are_listed_in_spanish(capsys):
    code, text = shown([], capsys)
    assert code == ExitCode.USAGE
    assert "La línea de órdenes del gemelo" in text
    assert "órdenes:\n" in text


def test_a_group_without_a_command_prints_its_help(capsys):
    code, text = shown(["bag"], capsys)
    assert code == ExitCode.USAGE
    assert "qué tiene una grabación" in text


@table(
    "line, said",
    [
        ("move --time", "gemelo move: argumento --time: espera un valor"),
        ("move --named", "gemelo move: argumento --named: espera un valor"),
        ("move --named a --to 0 0 0", "gemelo move: argumento --to: no va con el argumento --named"),
        ("move --named a --seed x", "gemelo move: argumento --seed: el valor 'x' no vale (int)"),
        ("move --time 3", "gemelo move: diga una de --to, --joints, --named, --execute"),
        ("move ready", "gemelo move: «ready» está sin opción: ¿quiso decir --named ready?"),
        ("state --jsn", "gemelo state: «--jsn» no es una opción: ¿quiso decir --json?"),
        ("hold now", "gemelo hold: «now» es una palabra de más: no tiene opciones"),
        ("output avanzar maybe", "gemelo output: No hay state «maybe»: hay on, off"),
        ("topic ecoh", "gemelo topic: No hay una orden «ecoh»: ¿quiso decir «echo»?"),
        ("scene remove", "gemelo scene remove: faltan los argumentos: NAME"),
        ("move --named a --time 3,5", "argumento --time: «3,5» no es un tiempo: el signo decimal es un punto"),
    ],
)
def test_what_the_parser_refuses_is_spanish(line, said, capsys):
    code, text = shown(line.split(), capsys)
    assert code == ExitCode.USAGE
    assert said in text


def test_the_one_message_of_argparse_that_is_replaced_is_one_that_it_has(capsys):
    parser = argparse.ArgumentParser()
    group = parser.add_mutually_exclusive_group(required=True)
    group.add_argument("--a")
    with pytest.raises(SystemExit):
        parser.parse_args([])
    assert ONE_OF % "--a" in capsys.readouterr().err
