"""The limits of what the clients of one node may ask for: per second, and waiting at a time.

A client is what it says of itself, and may give itself another name with each request: so what all clients of one
principal (bus/branches.py), which the router has verified, may ask together is limited too, and those that were first
seen a moment ago share one client's limit. A flood under forged names gets no more than one client that floods.
"""

from __future__ import annotations

import threading
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from gemelo.libraries.runtime.bus.pace import Rate, TokenBucket
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.reasons import Reason, because

# Chosen. A panel and its programs ask some ten times a second; a script that only asks goes by its pace (bus/pace.py),
# which stays below. A request that is dropped costs its server some 20 us, one that is answered 300.
# The burst is what a flood gets before nothing of it is taken, and a plan costs more than its request: of 1,000 plans a
# second 1,100 were made (1.1 s of processor time, beside any stop), with a burst of 1,000 2,000 of them (1.5 s).
OF_A_CLIENT = Rate(500.0, 550)  # requests to one node, and as many urgent ones; those above it are dropped unread
OF_NEWCOMERS = OF_A_CLIENT  # of all clients of one principal together that were first seen less than KNOWN_AFTER ago
OF_A_PRINCIPAL = Rate(3 * OF_A_CLIENT.per_second, 3 * OF_A_CLIENT.burst)  # of all its clients together
KNOWN_AFTER = 1.0  # [s] chosen: names that a flood invents do not live so long, and a person's command ends before
DEBT = 500  # requests above it that count as well: a flood is not carried out in part, which would cost far more
OF_REFUSALS = Rate(100.0, 1000)  # answers "busy" of one node; the other refusals are dropped without an answer
MAX_CLIENTS = 256  # of one principal that are known; those that come on top of them stay newcomers
MAX_NEWCOMERS = 1024  # chosen: twice as many as OF_NEWCOMERS lets in until they are known
MAX_PRINCIPALS = 64  # chosen: more than certificates of a site; those that come on top share one place

# Chosen: a script waits for its answers, so few clients ever have more than one request here.
MAX_WAITING_OF_A_CLIENT = 64  # requests of one client that wait in one server; more are refused
MAX_WAITING_OF_A_PRINCIPAL = 512  # as well, of all clients of one principal
MAX_WAITING = 1024  # requests of all clients that wait in one server; more are refused
# [bytes] of all requests that wait in one server, and of one client's: chosen, so that the largest one may wait.
MAX_WAITING_BYTES, MAX_WAITING_BYTES_OF_A_CLIENT = 96 * 1024 * 1024, 40 * 1024 * 1024


class Newcomer(NamedTuple):
    """A client that is not known yet."""

    bucket: TokenBucket
    first_seen: float  # [s] monotonic


class PrincipalRates:
    """The rates of one principal's requests; its clients are told apart by what they say."""

    def __init__(self, of_a_client: Rate, now: float) -> None:
        """`now` in [s] monotonic."""
        self._of_a_client = of_a_client
        self._all = TokenBucket(OF_A_PRINCIPAL, now)
        self._of_newcomers = TokenBucket(OF_NEWCOMERS, now, DEBT)
        self._known: dict[str, TokenBucket] = {}
        self._new: dict[str, Newcomer] = {}  # that were permitted; oldest first

    def permit(self, client: str, now: float) -> bool:
        """True if `client` may ask once more at `now` [s] monotonic."""
        if client not in self._known:
            self._promote(client, now)
        if client in self._known:
            return self._known[client].take(now) and self._all.take(now)
        newcomer = self._new.get(client) or Newcomer(TokenBucket(self._of_a_client, now, DEBT), now)
        if not (newcomer.bucket.take(now) and self._of_newcomers.take(now) and self._all.take(now)):
            return False
        self._new[client] = newcomer
        if len(self._new) > MAX_NEWCOMERS:
            del self._new[next(iter(self._new))]
        return True

    def is_idle(self, now: float) -> bool:
        """True if nothing has been asked for so long that all is as new at `now` [s] monotonic."""
        return self._all.is_full(now) and self._of_newcomers.is_full(now)

    def _promote(self, client: str, now: float) -> None:
        """A client that was first seen long enough ago is known from now on, if it has a place."""
        newcomer = self._new.get(client)
        if newcomer is None or now - newcomer.first_seen < KNOWN_AFTER:
            return
        if len(self._known) >= MAX_CLIENTS:
            self._known = {each: bucket for each, bucket in self._known.items() if not bucket.is_full(now)}
        if len(self._known) < MAX_CLIENTS:
            self._known[client] = self._new.pop(client).bucket


class RatesOfPrincipals:
    """The rates of all principals, each for itself; from any thread."""

    def __init__(self, of_a_client: Rate) -> None:
        self._of_a_client = of_a_client
        self._of: dict[str, PrincipalRates] = {}
        self._lock = threading.Lock()

    def permit(self, principal: str, client: str, now: float) -> bool:
        """True if `client` may ask once more at `now` [s] monotonic."""
        with self._lock:
            return self._rates(principal, now).permit(client, now)

    def _rates(self, principal: str, now: float) -> PrincipalRates:
        if (found := self._of.get(principal)) is not None:
            return found
        if len(self._of) >= MAX_PRINCIPALS:
            self._of = {each: rates for each, rates in self._of.items() if not rates.is_idle(now)}
        if len(self._of) >= MAX_PRINCIPALS:
            principal = ""
        return self._of.setdefault(principal, PrincipalRates(self._of_a_client, now))


class RequestRates:
    """The rates of one node, over all keys that it serves; from any thread.

    Urgent requests are counted for themselves, under a lock of their own: a stop waits for no thread that counts
    others, which in a flood may itself wait for the processor.
    """

    def __init__(self, of_a_client: Rate = OF_A_CLIENT, of_refusals: Rate = OF_REFUSALS, clock: Clock = SYSTEM) -> None:
        self._clock = clock
        self._urgent, self._others = RatesOfPrincipals(of_a_client), RatesOfPrincipals(of_a_client)
        self._refusals = TokenBucket(of_refusals, clock.monotonic())
        self._lock_of_refusals = threading.Lock()

    def permit_request(self, principal: str, client: str, urgent: bool = False) -> bool:
        """True if `client` may ask once more now."""
        return (self._urgent if urgent else self._others).permit(principal, client, self._clock.monotonic())

    def permit_refusal(self) -> bool:
        """True if one more request may be answered with why it is not carried out."""
        with self._lock_of_refusals:
            return self._refusals.take(self._clock.monotonic())


@dataclass
class WaitingRequests:
    """Counts the waiting requests and their bytes per client and principal, so that none can block the others."""

    key: str
    _of: Counter[tuple[str, str]] = field(default_factory=Counter, init=False)  # by principal and client
    _of_principal: Counter[str] = field(default_factory=Counter, init=False)
    _bytes_of: Counter[tuple[str, str]] = field(default_factory=Counter, init=False)  # by principal and client
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    def refusal(self, principal: str, client: str, size: int = 0) -> Reason | None:
        """Counts one more request of `client`, of `size` [bytes]; the reason if its limit is reached, else None."""
        with self._lock:
            if self._of[principal, client] >= MAX_WAITING_OF_A_CLIENT:
                return because("waiting.client", key=self.key, count=MAX_WAITING_OF_A_CLIENT)
            if self._of_principal[principal] >= MAX_WAITING_OF_A_PRINCIPAL:
                most = MAX_WAITING_OF_A_PRINCIPAL
                return because("waiting.certificate", key=self.key, count=most, certificate=principal)
            if self._of_principal.total() >= MAX_WAITING:
                return because("waiting.all", key=self.key, count=MAX_WAITING)
            if (refusal := self._size_refusal(principal, client, size)) is not None:
                return refusal
            self._of[principal, client] += 1
            self._of_principal[principal] += 1
            self._bytes_of[principal, client] += size
            return None

    def _size_refusal(self, principal: str, client: str, size: int) -> Reason | None:
        waiting, all_waiting = self._bytes_of[principal, client], self._bytes_of.total()
        if waiting + size > MAX_WAITING_BYTES_OF_A_CLIENT:
            most = MAX_WAITING_BYTES_OF_A_CLIENT
            return because("waiting.client.bytes", key=self.key, size=size, waiting=waiting, limit=most)
        if all_waiting + size > MAX_WAITING_BYTES:
            return because("waiting.all.bytes", key=self.key, size=size, waiting=all_waiting, limit=MAX_WAITING_BYTES)
        return None

    def leave(self, principal: str, client: str, size: int = 0) -> None:
        with self._lock:
            self._bytes_of[principal, client] -= size
            self._of[principal, client] -= 1
            self._of_principal[principal] -= 1
            if self._of[principal, client] <= 0:
                del self._of[principal, client], self._bytes_of[principal, client]
            if self._of_principal[principal] <= 0:
                del self._of_principal[principal]
