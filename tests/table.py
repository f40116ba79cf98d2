"""A table of cases as one test: every row is tried, and each that fails is named."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence

import pytest
from _pytest.mark import ParameterSet

Test = Callable[..., None]


def table(
    names: str | Sequence[str], rows: Iterable[object], ids: Sequence[str] | Callable[[object], object] | None = None
) -> Callable[[Test], Test]:
    """Is written as pytest.mark.parametrize; what the test's fixtures keep, they keep from one row to the next."""
    keys = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    cases = [ParameterSet.extract_from(row, force_tuple=len(keys) == 1) for row in rows]
    titles = [title(case, at, ids) for at, case in enumerate(cases)]
    assert cases, "a table without rows shows nothing"

    def decorate(test: Test) -> Test:
        own = inspect.signature(test).parameters
        fixtures = [each for name, each in own.items() if name not in keys and name != "subtests"]

        @functools.wraps(test)
        def try_all(subtests: pytest.Subtests, **given: object) -> None:
            also = {"subtests": subtests} if "subtests" in own else {}
            for title, case in zip(titles, cases, strict=True):
                with subtests.test(title):
                    test(**given, **also, **dict(zip(keys, case.values, strict=True)))

        wanted = inspect.Parameter("subtests", inspect.Parameter.KEYWORD_ONLY)
        try_all.__signature__ = inspect.Signature([*fixtures, wanted])  # type: ignore[attr-defined]
        return try_all

    return decorate


def title(case: ParameterSet, at: int, ids: Sequence[str] | Callable[[object], object] | None) -> str:
    """What a failure of the row is called: its id, else its values, shortened."""
    if case.id:
        return str(case.id)
    if ids is not None and not callable(ids):
        return ids[at]
    return "-".join(str(ids(value) if ids else value)[:80] for value in case.values)
