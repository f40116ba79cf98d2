"""The moment at which a goal counts as having lost its client; time is given."""

from __future__ import annotations

from collections.abc import Callable

from gemelo.libraries.runtime.client_watch import FIRST_SIGHT, LINGER, MAX_IDLE, RETURN, SETTLE, Absence, ClientWatch


class Tokens:
    """A bus whose tokens and router are switched by hand."""

    def __init__(self) -> None:
        self.is_connected = True
        self.watchers: dict[str, Callable[[bool], None]] = {}
        self.closed = 0

    def watch(self, key: str, on_change: Callable[[bool], None]) -> Tokens:
        self.watchers[key] = on_change
        return self

    def close(self) -> None:
        self.closed += 1


def watch() -> tuple[Tokens, ClientWatch]:
    tokens = Tokens()
    return tokens, ClientWatch(tokens.watch, lambda: tokens.is_connected)


def test_a_goal_is_lost_once_soon_after_its_token_vanishes() -> None:
    tokens, clients = watch()
    clients.add("goal", "@id/a", 100.0)
    tokens.watchers["@id/a"](True)
    assert clients.take_lost(160.0) == []
    tokens.watchers["@id/a"](False)
    assert clients.take_lost(160.0 + SETTLE / 2) == []
    assert clients.take_lost(160.0 + 1.1 * SETTLE) == [("goal", "@id/a")]
    assert clients.take_lost(170.0) == []
    assert tokens.closed == 1


def test_a_client_that_was_never_seen_is_given_a_little_longer() -> None:
    _, clients = watch()
    clients.add("goal", "@id/a", 100.0)
    assert clients.take_lost(100.0 + 0.9 * FIRST_SIGHT) == []
    assert clients.take_lost(100.0 + 1.1 * FIRST_SIGHT) == [("goal", "@id/a")]


def test_a_token_that_comes_back_in_time_keeps_the_goal() -> None:
    tokens, clients = watch()
    clients.add("goal", "@id/a", 100.0)
    for is_there in (True, False, True):
        tokens.watchers["@id/a"](is_there)
    assert clients.take_lost(200.0) == []


def test_nothing_is_concluded_while_the_router_is_away_nor_right_after_it() -> None:
    tokens, clients = watch()
    clients.add("goal", "@id/a", 100.0)
    tokens.watchers["@id/a"](True)
    tokens.is_connected = False
    tokens.watchers["@id/a"](False)
    assert clients.take_lost(130.0) == []
    tokens.is_connected = True
    assert clients.take_lost(131.0) == []
    assert clients.take_lost(131.0 + 0.9 * RETURN) == []
    assert clients.take_lost(131.0 + 1.1 * RETURN) == [("goal", "@id/a")]


def test_what_was_missing_when_the_router_came_back_counts_from_a_while_after_that() -> None:
    tokens = Tokens()
    absence = Absence(tokens.watch, lambda: tokens.is_connected, "@id/a", 100.0)
    tokens.watchers["@id/a"](True)
    assert absence.seconds(110.0) == 0.0
    tokens.watchers["@id/a"](False)
    assert absence.seconds(112.0) == 2.0
    tokens.is_connected = False
    assert absence.seconds(120.0) == 0.0
    tokens.is_connected = True
    assert absence.seconds(121.0) == 0.0
    assert absence.seconds(121.0 + RETURN) == 0.0
    assert absence.seconds(121.0 + RETURN + 3.0) == 3.0
    absence.close()
    assert tokens.closed == 1


def test_a_goal_that_has_ended_is_forgotten_and_its_client_after_a_while() -> None:
    tokens, clients = watch()
    clients.add("goal", "@id/a", 100.0)
    clients.forget("goal")
    clients.forget("goal")
    assert clients.take_lost(100.0 + 0.9 * LINGER) == []
    assert tokens.closed == 0
    assert clients.take_lost(100.0 + 1.1 * LINGER) == []
    assert tokens.closed == 1


def test_the_next_goal_of_a_client_that_was_seen_needs_no_first_sight() -> None:
    """On a machine without time to spare the bus took longer than that to tell of a client that was there."""
    tokens, clients = watch()
    clients.add("first", "@id/a", 100.0)
    tokens.watchers.pop("@id/a")(True)
    clients.forget("first")
    clients.take_lost(110.0)
    clients.add("second", "@id/a", 110.0)
    assert not tokens.watchers, "it is watched already"
    assert clients.take_lost(110.0 + 10.0 * FIRST_SIGHT) == []


def test_a_client_that_vanished_between_its_goals_is_given_the_time_of_a_first_sight() -> None:
    tokens, clients = watch()
    clients.add("first", "@id/a", 100.0)
    clients.forget("first")
    for is_there in (True, False):
        tokens.watchers["@id/a"](is_there)
    clients.add("second", "@id/a", 120.0)
    assert clients.take_lost(120.0 + 0.9 * FIRST_SIGHT) == []
    assert clients.take_lost(120.0 + 1.1 * FIRST_SIGHT) == [("second", "@id/a")]


def test_all_goals_of_a_client_are_lost_with_it() -> None:
    tokens, clients = watch()
    for goal in ("one", "next"):
        clients.add(goal, "@id/a", 100.0)
    for is_there in (True, False):
        tokens.watchers["@id/a"](is_there)
    assert clients.take_lost(105.0) == [("next", "@id/a"), ("one", "@id/a")]


def test_of_many_clients_that_have_no_goals_the_last_are_watched() -> None:
    tokens, clients = watch()
    for number in range(MAX_IDLE + 5):
        clients.add("goal", f"@id/{number}", 100.0 + number)
        clients.forget("goal")
    clients.take_lost(100.0 + MAX_IDLE + 5)
    assert tokens.closed == 5
