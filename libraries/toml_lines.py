"""The line of every key and element of a TOML text, which the parser of the standard library does not give."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Mapping

import msgspec

from gemelo.schemas.reasons import Reason, because

Where = tuple[str | int, ...]  # keys, and indices of arrays

BLANK = " \t"
SPACE = " \t\r\n"


def toml_lines(text: str) -> dict[Where, int]:
    """Line (from 1) by place, of a text that `tomllib` has read; headers, keys and elements of arrays."""
    return _Scanner(text.replace("\r\n", "\n")).scan()


def nearest_line(lines: Mapping[Where, int], place: Where) -> int:
    """The line of `place`, or of the nearest thing around it that is written; 0 where there is none."""
    return next((lines[place[:end]] for end in range(len(place), 0, -1) if place[:end] in lines), 0)


def syntax_mistake(error: tomllib.TOMLDecodeError, text: str) -> tuple[int, Reason]:
    """The line (from 1) of what is not TOML, and what is wrong with it, in the parser's words."""
    at = re.search(r" \(at line (\d+), column (\d+)\)$", str(error))
    if at is None:
        problem = str(error).removesuffix(" (at end of document)")
        return text.rstrip().count("\n") + 1, because("file.toml.end", problem=problem)
    problem = str(error)[: at.start()]
    return int(at[1]), because("file.toml.syntax", problem=problem, column=int(at[2]))


def type_mistake(error: msgspec.ValidationError, text: str) -> tuple[int, Reason]:
    """The line of the key that a wrong type or a value out of bounds stands at, 0 where it is not found, and what is
    wrong."""
    problem, _, at = str(error).partition(" - at ")
    key = at.strip("`").removeprefix("$").removeprefix(".")
    words = re.findall(r"\w+", key)
    place = tuple(int(word) if word.isdecimal() else word for word in words)
    line = nearest_line(toml_lines(text), place) if words else 0
    if found := re.fullmatch(r"Expected `(.+)`, got `(.+)`", problem):
        return line, because("file.value.type", key=key, expected=found[1], given=found[2])
    if found := re.fullmatch(r"Expected `(.+?)` (.+)", problem):
        return line, because("file.value.bound", key=key, expected=found[1], bound=found[2])
    if found := re.fullmatch(r"Object missing required field `(.+)`", problem):
        return line, because("file.value.missing", key=key, field=found[1])
    if found := re.fullmatch(r"Invalid enum value (.+)", problem):
        return line, because("file.value.enum", key=key, value=found[1])
    return line, because("file.value.wrong", key=key, problem=problem)


class _Scanner:
    """One pass over a text that is known to be TOML, so nothing is checked again."""

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self._lines: dict[Where, int] = {}
        self._tables: Counter[Where] = Counter()  # how many tables an array of tables has so far
        self._counted, self._line = 0, 1  # lines are counted up to here

    def scan(self) -> dict[Where, int]:
        table: Where = ()
        while self._skip(SPACE):
            if self._next("[["):
                table = self._header(is_array=True)
                self._at += 2
            elif self._next("["):
                table = self._header(is_array=False)
                self._at += 1
            else:
                self._pair(table)
        return self._lines

    def _header(self, is_array: bool) -> Where:
        self._at += 2 if is_array else 1
        line, keys = self._here(), self._keys()
        place: Where = ()
        for key in keys[:-1]:
            place = self._newest((*place, key))
            self._lines.setdefault(place, line)
        place = (*place, keys[-1])
        if is_array:
            self._lines.setdefault(place, line)
            self._tables[place] += 1
        place = self._newest(place)
        self._lines[place] = line
        return place

    def _newest(self, place: Where) -> Where:
        """The last table of an array of tables, or the place itself."""
        return (*place, self._tables[place] - 1) if place in self._tables else place

    def _pair(self, table: Where) -> None:
        line, place = self._here(), table
        for key in self._keys():
            place = (*place, key)
            self._lines.setdefault(place, line)
        self._at += 1  # "="
        self._value(place)

    def _keys(self) -> list[str]:
        """A dotted key."""
        keys = [self._key()]
        while self._skip(BLANK) and self._text[self._at] == ".":
            self._at += 1
            keys.append(self._key())
        return keys

    def _key(self) -> str:
        self._skip(BLANK)
        start = self._at
        if self._text[start] in "\"'":
            self._string()
            return str(tomllib.loads(f"key = {self._text[start : self._at]}")["key"])
        while self._text[self._at] not in " \t.=]":
            self._at += 1
        return self._text[start : self._at]

    def _value(self, place: Where) -> None:
        self._skip(BLANK)
        first = self._text[self._at]
        if first in "\"'":
            self._string()
        elif first == "[":
            self._array(place)
        elif first == "{":
            self._inline_table(place)
        else:
            while self._at < len(self._text) and self._text[self._at] not in ",]}#\n":
                self._at += 1

    def _array(self, place: Where) -> None:
        self._at += 1
        index = 0
        while self._skip(SPACE) and self._text[self._at] != "]":
            if self._text[self._at] == ",":
                self._at += 1
                continue
            self._lines[(*place, index)] = self._here()
            self._value((*place, index))
            index += 1
        self._at += 1

    def _inline_table(self, place: Where) -> None:
        self._at += 1
        while self._skip(SPACE) and self._text[self._at] != "}":
            if self._text[self._at] == ",":
                self._at += 1
            else:
                self._pair(place)
        self._at += 1

    def _string(self) -> None:
        """To behind its end; a long one may end with two quotes more that belong to it."""
        quote = self._text[self._at]
        is_long = self._next(quote * 3)
        end = quote * 3 if is_long else quote
        self._at += len(end)
        while not self._next(end):
            self._at += 2 if quote == '"' and self._text[self._at] == "\\" else 1
        self._at += len(end)
        while is_long and self._next(quote):
            self._at += 1

    def _skip(self, blank: str) -> bool:
        """Over blanks and comments; False at the end."""
        while self._at < len(self._text):
            if self._text[self._at] == "#" and blank is SPACE:
                end = self._text.find("\n", self._at)
                self._at = len(self._text) if end < 0 else end
            elif self._text[self._at] not in blank:
                return True
            else:
                self._at += 1
        return False

    def _next(self, word: str) -> bool:
        return self._text.startswith(word, self._at)

    def _here(self) -> int:
        self._line += self._text.count("\n", self._counted, self._at)
        self._counted = self._at
        return self._line
