"""An example of each code: a reason as its cause made it in a test.

tests/schemas/examples.py writes them into examples.json.
"""

from __future__ import annotations

import string
from functools import cache
from pathlib import Path

import msgspec

from gemelo.schemas.reasons.catalogue import ENGLISH, template
from gemelo.schemas.reasons.reason import Reason
from gemelo.schemas.reasons.sentences import PLAIN, WITHIN, Value
from gemelo.schemas.reasons.units import in_si_units

FILE = Path(__file__).with_name("examples.json")


def example_of(code: str) -> Reason:
    """A reason of that code; where no test has made one that fits, each value is its own name, or 1."""
    found = examples().get(code)
    if found is not None and fits(found):
        return found
    return Reason(code=code, values=_names(template(code, ENGLISH) or ""))


def fits(reason: Reason) -> bool:
    """It has the values of its template, and so have the reasons behind it."""
    text = template(reason.code, ENGLISH)
    own = text is not None and set(_names(text)) == set(reason.values)
    return (own or reason.code == PLAIN) and all(fits(each) for each in reason.causes)


@cache
def examples() -> dict[str, Reason]:
    """By code."""
    found = msgspec.json.decode(FILE.read_bytes(), type=tuple[Reason, ...])
    return {each.code: each for each in found}


def _names(text: str) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for _, name, spec, _ in string.Formatter().parse(text):
        if name and name not in WITHIN:
            values.setdefault(name, 1 if spec and _is_number(spec) else name)
        if spec and "{" in spec:
            values |= dict.fromkeys((each for _, each, _, _ in string.Formatter().parse(spec) if each), "rad")
    return values


def _is_number(spec: str) -> bool:
    return (
        spec != "names"
        and not spec.startswith("word")
        and ("{" in spec or spec.partition(".")[0] in in_si_units or spec[-1] in "defgn%")
    )
