"""Choice of the messages that are published: all while anything changes, few of what repeats itself."""

from __future__ import annotations

from typing import Any

from gemelo.schemas.message import Message
from gemelo.schemas.topics import Topic
from gemelo.services.stepper_gateway.moment import Moment

NO_CHANGE = ("stamp", "round_trip")  # fields that are measured anew for each message, also at rest
NEWCOMER = 0.6  # [s] after a node has come, in which nothing is left out; chosen: three messages of the slowest topic

FOR_NEWCOMER = 0.04  # [s] meanwhile between two of what comes seldom; chosen: nobody sees that he waits for it


class RestThinner:
    """What differs from the one before passes at once; between equal ones the gap at most doubles each time.

    A reader that calls a topic stale after five of its latest gaps (`libraries/runtime/topics.py`) therefore never does
    so because the arm has come to rest.
    """

    def __init__(self, shortest: float) -> None:
        """`shortest` [s] between two that are equal."""
        self._shortest = self._gap = shortest  # [s]
        self._last: object = None
        self._passed = 0.0  # [s] the one that passed last

    def passes(self, content: object, at: float, longest: float) -> bool:
        """True if what says `content` at `at` [s] is to be published; `longest` [s] between two at rest: nothing is
        left out where that is not longer than the shortest."""
        last, self._last = self._last, content
        is_alike = content == last and at >= self._passed  # else its clock begins anew
        if is_alike and not self.is_due(at, longest):
            return False
        self._gap = max(self._shortest, min(2.0 * self._gap, longest)) if is_alike else self._shortest
        self._passed = at
        return True

    def is_due(self, at: float, longest: float) -> bool:
        """True if what repeats the one before would pass at `at` [s]."""
        since = at - self._passed
        return longest <= self._shortest or not 0.0 <= since < self._gap - 0.5 * self._shortest


class RestingTopics:
    """A thinner for each topic; none thins while a node is new, which would otherwise wait for what rests."""

    def __init__(self) -> None:
        self._thinners: dict[str, RestThinner] = {}
        self._all_until = float("-inf")  # [s] monotonic

    def on_newcomer(self, moment: Moment) -> None:
        """A node has come."""
        self._all_until = moment.monotonic + NEWCOMER

    def period(self, usual: float, moment: Moment) -> float:
        """[s] between two looks whether a reading has changed, `usual` [s] but while a node is new."""
        return min(usual, FOR_NEWCOMER) if moment.monotonic < self._all_until else usual

    def longest_gap(self, rest_rate: float, moment: Moment) -> float:
        """[s] between two at rest, with `rest_rate` [Hz]; 0 while nothing is left out."""
        return 0.0 if moment.monotonic < self._all_until else 1.0 / rest_rate

    def passes(self, topic: Topic[Any], message: Message, rest_rate: float, moment: Moment) -> bool:
        """True if `message` is to be published; `rest_rate` [Hz] while nothing in it changes."""
        thinner = self._thinners.get(topic.key)
        if thinner is None:
            thinner = self._thinners[topic.key] = RestThinner(1.0 / (topic.rate or rest_rate))
        content = [getattr(message, name) for name in message.__struct_fields__ if name not in NO_CHANGE]
        return thinner.passes(content, moment.monotonic, self.longest_gap(rest_rate, moment))
