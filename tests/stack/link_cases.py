"""The table of links that fail in the middle of a move, and what docs/inside/failures.md allows to come of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from tests.stack.ethernet import CUT, OPEN, Way

FINISHED, HELD = "finished", "held"
TOLD = 3.0  # [s] after the cut, or else after the arm's rest or the link's return, whichever is later
ROUTER_LOST = 12.0  # [s] of a link of the client's own or the router's: 1 s until it counts as away, and 10 s
WAYS = {(True, True): "both", (True, False): "out", (False, True): "into"}


@dataclass(frozen=True)
class Case:
    """One link in the middle of one move."""

    host: str  # whose link
    lasts: float  # [s]; 0: as long as the move
    out: Way = OPEN
    into: Way = OPEN
    is_attached: bool = False  # the goal ends with its client

    @property
    def name(self) -> str:
        slow = max(self.out.delay, self.into.delay)
        cut = WAYS.get((self.out.is_cut, self.into.is_cut))
        what = f"cut-{cut}-{self.lasts:g}s" if cut else f"slow-{slow * 1e3:.0f}ms"
        return f"{self.host}-{what}" + "-attached" * self.is_attached


def cuts(host: str, is_attached: bool = False) -> Iterator[Case]:
    for lasts, (out, into) in product((0.2, 1.0, 10.0), ((CUT, CUT), (CUT, OPEN), (OPEN, CUT))):
        yield Case(host, lasts, out, into, is_attached)


def slow(host: str, delay: float) -> Case:
    way = Way(delay=delay, jitter=0.3 * delay)
    return Case(host, 0.0, way, way)


HOSTS = ("desk", "brain", "cell", "board")
CASES = (
    *(case for host in HOSTS for case in (*cuts(host), slow(host, 0.05), slow(host, 0.3))),
    *cuts("desk", is_attached=True),
)  # fmt: skip


def expected(case: Case) -> tuple[tuple[str, str], ...]:
    """What docs/inside/failures.md's table allows: what the arm does, with what the client hears.

    The board holds after 0.5 s without a heartbeat, so a short cut or a slow way there may hold the arm or not; a
    client is missed after the lease of 1 s. Over 300 ms each way a session that was lost does not open again: its
    handshake takes several round trips, and OPEN_TIMEOUT_MS is 1 s. The cell's link carries heartbeats as well as the
    gateway's session: over 300 ms it may lose either, both or none.
    """
    done, late = (FINISHED, "SUCCEEDED"), (FINISHED, "ServerLost")
    held, lost, canceled = (HELD, "ABORTED"), (HELD, "ServerLost"), (HELD, "CANCELED")
    is_long, is_slow = case.lasts >= 10.0, case.out.delay > 0.1
    if case.host in ("cell", "board"):
        if case.lasts >= 1.0:
            return held, lost
        if is_slow and case.host == "cell":
            return done, late, held, lost
        return (done, held) if case.lasts or is_slow else (done,)
    if case.is_attached and case.lasts >= 1.0:
        return (canceled, lost) if is_long else (done, canceled)
    return (done, late) if is_long or is_slow else (done,)


def told_within(case: Case, status: str, rested: float) -> float:
    """[s] since the beginning of the fault within which docs/inside/failures.md's table has the client hear `status`.

    The arm came to rest at `rested` [s]. A link that is only slow may break at any moment until then.
    """
    is_own = case.host in ("desk", "brain")  # what is said meanwhile comes when the link is back
    since = 0.0 if case.lasts else rested
    if status == "ServerLost":
        return since + (ROUTER_LOST if is_own else TOLD)
    return (since if status == "ABORTED" and not is_own else max(rested, case.lasts)) + TOLD
