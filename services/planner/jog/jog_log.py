"""Log of a jog's inputs, published twice a second and at its end: enough for `gemelo replay` to jog that way again."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import msgspec

from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.planning import JogCommand, JogInputs, JogStatus, JogTaken, JogTick, SceneVersion
from gemelo.schemas.reasons import Reason

MOST = 25  # inputs of one message; chosen: half a second of periods
LARGE = 256 * 1024  # [bytes] of one message; chosen: a command may be as large as any message (bus/wire.py)
DIGEST = 8  # [B] chosen: two periods of one jog differ by chance once in 2^64


class JogLog:
    """Keeps inputs until `publish` is given them; `is_on` says if any are kept. Pure.

    After it was off there is a gap in the numbers of the messages.
    """

    def __init__(self, publish: Callable[[JogInputs], object], is_on: Callable[[], bool]) -> None:
        self._publish, self._is_on = publish, is_on
        self._inputs: list[JogTaken | JogTick] = []
        self._number, self._stamp, self._has_gap = 0, 0, False
        self._size = 0  # [bytes] of the inputs
        self._told: SceneVersion | None = None  # the scene of the tick before

    def taken(self, now: float, command: JogCommand, client: str, begins: bool, stamp: int) -> None:
        """A command that the jog is given at `now` [s] monotonic, `stamp` [ns] UNIX."""
        if begins:
            self._told = None
        self._add(JogTaken(now=now, command=command, client=client, begins=begins), stamp)

    def ticked(
        self, now: float, stamp: int, present: JointState | None, age: float, goal_is_active: bool,
        not_ready: Reason | None,
        scene: SceneVersion, told_to: str, said: str,
    ) -> None:  # fmt: skip
        """A step of the jog at `now` [s] monotonic, `stamp` [ns] UNIX, with `present` of `age` [s]; and the `digest_of`
        what was said."""
        is_same, self._told = scene == self._told, scene
        tick = JogTick(
            now=now, stamp=stamp, present=present, age=age if present is not None else 0.0,  # infinite before the first
            goal_is_active=goal_is_active, not_ready=str(not_ready or ""), scene=None if is_same else scene,
            told_to=told_to, said=said, why=not_ready,
        )  # fmt: skip
        self._add(tick, stamp)

    def finish(self) -> None:
        """Publishes what is left: the jog stands."""
        if self._inputs:
            self._publish(JogInputs(stamp=self._stamp, number=self._number, inputs=tuple(self._inputs)))
            self._number, self._inputs, self._size = self._number + 1, [], 0

    def _add(self, given: JogTaken | JogTick, stamp: int) -> None:
        if not self._is_on():
            self._inputs, self._size, self._told, self._has_gap = [], 0, None, True
            return
        self._number, self._has_gap = self._number + self._has_gap, False
        self._stamp = self._stamp if self._inputs else stamp
        size = len(msgspec.msgpack.encode(given))
        if self._size + size > LARGE:
            self.finish()
        self._size += size
        self._inputs.append(given)
        if len(self._inputs) >= MOST:
            self.finish()


def digest_of(targets: JointTargets | None, status: JogStatus | None) -> str:
    """A checksum of what was published in one period; empty where that was nothing."""
    if targets is None and status is None:
        return ""
    published = (
        b"-" if targets is None else _without_chunk(targets),
        b"-" if status is None else _without_reasons(status),
    )
    return hashlib.blake2b(b"".join(published), digest_size=DIGEST).hexdigest()


def _without_chunk(targets: JointTargets) -> bytes:
    """In msgpack; without the fields that no jog uses, which older recordings do not have."""
    fields = msgspec.to_builtins(targets)
    del fields["ahead"], fields["to_watch"]
    return msgspec.msgpack.encode(fields)


def _without_reasons(status: JogStatus) -> bytes:
    """In msgpack; its sentences are made of its reasons, which older recordings do not have."""
    fields = msgspec.to_builtins(status)
    for part in (fields, *fields["limits"]):
        del part["why"]
    return msgspec.msgpack.encode(fields)
