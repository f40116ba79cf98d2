"""`gemelo explain`: what a code of a reason means, with an example; `gemelo languages`: what a language lacks."""

from __future__ import annotations

import string
import textwrap
from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

import msgspec

from gemelo.schemas.reasons import FrontEnd, Reason, because, remedy, say
from gemelo.schemas.reasons.catalogue import ENGLISH, EXPLAIN, HELP, codes, entries, explanation, languages, template
from gemelo.schemas.reasons.examples import example_of
from gemelo.tools.cli.common.errors import ExitCode, nearest, unknown, usage
from gemelo.tools.cli.common.language import language, sentence
from gemelo.tools.cli.parser import Options, json_option

if TYPE_CHECKING:
    from gemelo.tools.cli.parser import Parser

WIDTH = 100
NEEDED = ("", EXPLAIN, HELP)  # contexts of texts that each language has; words of one front end are as many as it likes


class InLanguage(msgspec.Struct, frozen=True):
    """A code in one language."""

    meaning: str
    template: str
    example: str


class Explanation(msgspec.Struct, frozen=True):
    """A code, the same in every language of the reader."""

    code: str
    values: tuple[str, ...]
    example: Reason
    languages: dict[str, InLanguage]


def add_options(parser: Parser) -> None:
    """The code, or the beginning of some."""
    parser.add_argument("code", nargs="?", metavar="CODE", help="of a reason, as goal.limit.position, or its beginning")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Explains one code; lists those that begin as it says, or all of them."""
    name = options.code or ""
    known = codes()
    found = [name] if name in known else [each for each in known if each.startswith(f"{name}." if name else "")]
    if not found:
        guess = nearest(name, known)
        raise usage(
            because(
                "cli.explain.unknown",
                remedy("did_you_mean", name=guess) if guess else remedy("list_codes"),
                name=name,
            )
        )
    if options.json:
        print(msgspec.json.encode([explained(code) for code in found]).decode())
    elif found == [name]:
        print("\n".join(_lines(name)))
    else:
        print("\n".join(_listed(found)))
    return ExitCode.OK


def explained(code: str) -> Explanation:
    """All that the catalogue has of a code."""
    example = example_of(code)
    texts = {
        each: InLanguage(explanation(code, each), template(code, each) or "", say(example, each))
        for each in languages()
    }
    return Explanation(code, tuple(places(template(code, ENGLISH) or "")), example, texts)


def places(text: str) -> list[str]:
    """The names of the values in a template, without those that are made of its causes and remedies."""
    found: dict[str, None] = {}
    for _, name, spec, _ in string.Formatter().parse(text):
        found |= dict.fromkeys([name] if name else []) | dict.fromkeys(places(spec) if spec else [])
    return [name for name in found if name not in ("causes", "remedies")]


def _lines(code: str) -> Iterator[str]:
    """What is printed of one code."""
    example = example_of(code)
    yield code
    yield from textwrap.wrap(_meaning(code), WIDTH, initial_indent="  ", subsequent_indent="  ")
    yield sentence(because("cli.explain.heading.example", sentence=sentence(example)))
    for each in example.remedies:
        text = say(Reason(code=each.code, values=each.values), language(), FrontEnd.COMMAND)
        yield sentence(because("cli.explain.heading.remedy", sentence=text))
    if names := places(template(code, ENGLISH) or ""):
        yield sentence(because("cli.explain.heading.values", names=", ".join(names)))


def _listed(found: list[str]) -> Iterator[str]:
    """Codes by subject, each with its template."""
    width = max(len(code) for code in found)
    for subject, group in groupby(found, lambda code: code.partition(".")[0] if "." in code else ""):
        meaning = _meaning(subject or "remedies")
        yield from ("", *textwrap.wrap(meaning, WIDTH)) if meaning else ("",)
        for code in group:
            yield f"  {code:{width}}  {template(code, language()) or template(code, ENGLISH)}"


def _meaning(code: str) -> str:
    return explanation(code, language()) or explanation(code, ENGLISH)


def language_options(parser: Parser) -> None:
    """The language of which the missing texts are wanted."""
    parser.add_argument("name", nargs="?", metavar="LANGUAGE", help="list what is missing in it, one a line")
    json_option(parser)


def run_languages(options: Options) -> ExitCode:
    """The languages, or what one lacks of what any of the others has."""
    lacking = {each: missing(each) for each in languages()}
    if options.name and options.name not in lacking:
        raise unknown("language", options.name, lacking)
    if options.json:
        print(msgspec.json.encode({options.name: lacking[options.name]} if options.name else lacking).decode())
    elif options.name:
        print("\n".join(lacking[options.name] or [_count_line(options.name, [])]))
    else:
        print("\n".join(_count_line(each, lacks) for each, lacks in lacking.items()))
    return ExitCode.OK


def missing(name: str) -> list[str]:
    """The texts that another language has and `name` does not, each with its context where it has one."""
    return [f"{context}: {each}" if context else each for context, each in sorted(_wanted(name) - entries(name))]


def _wanted(name: str) -> frozenset[tuple[str, str]]:
    everything = frozenset[tuple[str, str]]().union(*(entries(each) for each in languages()))
    contexts = NEEDED if name != ENGLISH else NEEDED[:2]
    return frozenset(each for each in everything if each[0] in contexts)


def _count_line(name: str, lacks: list[str]) -> str:
    count = len(_wanted(name))
    if lacks:
        return sentence(because("cli.languages.lacks", language=name, missing=len(lacks), count=count))
    return sentence(because("cli.languages.whole", language=name, count=count))
