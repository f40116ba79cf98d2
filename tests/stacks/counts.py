"""The count of whole stacks and browsers that the tests have started, in the last lines of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest

from gemelo.tools.stack.stack import Stack

STARTS: Counter[str] = Counter()  # of this process and, in a run on several, of those that have ended


def count_start(what: str) -> None:
    """Counts one more start of `what`."""
    STARTS[what] += 1


@pytest.fixture(scope="session", autouse=True)
def stacks_are_counted() -> Iterator[None]:
    """Every stack, whoever starts it in the tests' processes; those of chaos and demo start their own."""
    start = Stack.start

    def counted(stack: Stack) -> None:
        count_start("whole stacks")
        start(stack)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stack, "start", counted)
        yield


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A worker hands its count to the process that has started it."""
    output: dict[str, Any] | None = getattr(session.config, "workeroutput", None)
    if output is not None:
        output["starts"] = dict(STARTS)


def pytest_testnodedown(node: Any) -> None:
    """In that process, when a worker has ended."""
    STARTS.update(getattr(node, "workeroutput", {}).get("starts", {}))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line, where anything was started."""
    if STARTS:
        said = ", ".join(f"{number} {what}" for what, number in sorted(STARTS.items()))
        terminalreporter.write_line(f"the tests have started {said}")
