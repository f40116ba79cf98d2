"""Keeps an example of each code as a test's real cause made it: `pytest -n 0 -p tests.schemas.examples TESTS`.

It adds to schemas/reasons/examples.json what is not there, and takes out what no longer fits the catalogue.
"""

from __future__ import annotations

import re

import msgspec
import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas import reasons
from gemelo.schemas.reasons import PLAIN, Reason, Remedy, Value
from gemelo.schemas.reasons.catalogue import codes
from gemelo.schemas.reasons.examples import FILE, examples, fits

FOLDERS = re.compile(rf"(?:{re.escape(str(project_root()))}|/tmp|/root|/home)(?:/[\w.@+-]+)*/")
_seen: dict[str, Reason] = {}


def without_folders(reason: Reason) -> Reason:
    """No path of the machine that it was made on."""
    return msgspec.json.decode(FOLDERS.sub("", msgspec.json.encode(reason).decode()), type=Reason)


def keeping(reason: Reason) -> Reason:
    if reason.code != PLAIN:
        _seen.setdefault(reason.code, reason)
    return reason


_made, _remedied = reasons.because, reasons.remedy


def _because(code: str, /, *parts: Reason | Remedy, **values: Value) -> Reason:
    return keeping(_made(code, *parts, **values))


def _remedy(code: str, /, **values: Value) -> Remedy:
    keeping(Reason(code=code, values=dict(values)))
    return _remedied(code, **values)


reasons.because, reasons.remedy = _because, _remedy  # as this is read: before the modules that make reasons


def pytest_unconfigure(config: pytest.Config) -> None:
    known = codes()
    found = {code: without_folders(each) for code, each in _seen.items() if code in known and fits(each)}
    kept = {**found, **{code: each for code, each in examples().items() if code in known and fits(each)}}
    lines = (msgspec.json.encode(kept[code]).decode() for code in sorted(kept))
    FILE.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")
