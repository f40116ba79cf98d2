"""A board's memory in one line, as it says it of itself, and what to do where little of it is left."""

from __future__ import annotations

from typing import Protocol

from gemelo.schemas.reasons import Reason, because

LOW_HEAP = 12_000  # [bytes] chosen: a new TLS connection asks for more than that at once
LOW_STACK = 400  # [bytes] chosen: an interrupt and one more call


class MemoryLeft(Protocol):
    """As `status` has it; 0 and empty where the board does not say."""

    @property
    def heap_free(self) -> int: ...
    @property
    def heap_least(self) -> int: ...
    @property
    def stack_least(self) -> int: ...
    @property
    def stack_task(self) -> str: ...


def memory_left(left: MemoryLeft) -> Reason | None:
    """How much there is; None of a board that does not say."""
    if not left.heap_free:
        return None
    return because(
        "memory.left", free=left.heap_free, least=left.heap_least, task=left.stack_task, stack=left.stack_least
    )


def memory_low(left: MemoryLeft) -> Reason | None:
    """What is about to run out, with the remedy; None where nothing is."""
    if not left.heap_free:
        return None
    if left.heap_least < LOW_HEAP:
        return because("memory.low.heap", least=left.heap_least, enough=LOW_HEAP)
    if left.stack_least < LOW_STACK:
        return because("memory.low.stack", task=left.stack_task, stack=left.stack_least, enough=LOW_STACK)
    return None
