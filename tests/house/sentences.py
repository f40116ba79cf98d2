"""Sentences in the code itself: what an exception carries or a call prints, that does not come from the catalogue."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

from tests.house.counts import Module

MOST_WORDS = 3  # of a literal: more is a sentence
PRINTING = frozenset(("print", "write", "writelines", "say", "draw", "exit", "usage", "CommandError"))
HELP = frozenset(("help", "epilog", "metavar"))  # of an argument: their texts are msgids of the catalogue themselves
WORD = re.compile(r"[^\W\d_]{2,}")
CODE = re.compile(r"[a-z]\w*(?:\.\w+)+")  # of a reason
DRAWING = "<"  # begins what is written in SVG


class Sentence(NamedTuple):
    """A literal that a person would read, the line it stands in, and what carries it."""

    line: int
    carrier: str  # the exception's or the function's name
    text: str


def sentences(module: Module) -> Iterator[Sentence]:
    """Those of a module that are raised, or given to a call that prints."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            yield from _given(node.exc)
        elif isinstance(node, ast.Call) and _name(node) in PRINTING:
            yield from _given(node)


def _given(call: ast.Call) -> Iterator[Sentence]:
    values = [*call.args, *(word.value for word in call.keywords)]
    for text in (" ".join(_literals(value)) for value in values):
        if _is_sentence(text):
            yield Sentence(call.lineno, _name(call), text)


def made_sentences(module: Module) -> Iterator[Sentence]:
    """Those that are put together of words and values, whatever becomes of them; not the texts of help."""
    help_texts: set[int] = set()
    for node in ast.walk(module.tree):
        if _is_help(node):
            help_texts |= set(map(id, ast.walk(node)))
    for node in ast.walk(module.tree):
        text = " ".join(_literals(node)) if isinstance(node, ast.JoinedStr) and id(node) not in help_texts else ""
        if isinstance(node, ast.JoinedStr) and _is_sentence(text):
            yield Sentence(node.lineno, "f-string", text)


def _is_help(node: ast.AST) -> bool:
    if isinstance(node, ast.Assign):
        return ast.unparse(node.targets[0]).rpartition(".")[2] in HELP
    return isinstance(node, ast.keyword) and node.arg in HELP


def _is_sentence(text: str) -> bool:
    is_other = CODE.fullmatch(text) is not None or text.startswith(DRAWING)
    return len(WORD.findall(text)) > MOST_WORDS and not is_other


def _literals(node: ast.expr) -> Iterator[str]:
    """The fixed text of an expression; what a call returns is not looked into."""
    match node:
        case ast.Constant(value=str()):
            yield node.value
        case ast.JoinedStr(values=parts):
            for part in parts:
                yield from _literals(part.value if isinstance(part, ast.FormattedValue) else part)
        case ast.IfExp(body=body, orelse=other):
            yield from (*_literals(body), *_literals(other))
        case ast.BinOp(left=left, right=right):
            yield from (*_literals(left), *_literals(right))
        case ast.Call(func=ast.Attribute(attr="format" | "join", value=text)):
            yield from _literals(text)


def _name(call: ast.Call) -> str:
    match call.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
    return ""
