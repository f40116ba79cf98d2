"""Permissions of each role for each key, and the access control of the router that enforces them.

Zenoh's access control looks at every message between router and session, in both directions: `ingress` is what a
session sends, `egress` what it is sent. What no rule allows is dropped without a word.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

from schemas.roles import ROLES, SERVICES, Role, carried_out_by, served_by, written_by
from schemas.topics import ACTIONS, REQUESTS, Request
from services.runtime.actions import keys
from services.runtime.bus.identity import ALIVE
from services.runtime.requests.exchanges import exchange_topic

ADVANCED = "@adv/**"  # below an EVERY or LATCHED key: Zenoh's heartbeat, cache and token of its writer
ABOUT = ("info", "interfaces", "parameters/list")  # what every node answers about itself
SET = "parameters/set"
TOKENS = (f"{ALIVE}/*", "@id/*/*")
IN, OUT = ("ingress",), ("egress",)

Rule = dict[str, object]
AnyRequest = Request[Any, Any]


class Keyed(Protocol):
    """A topic, a request or an action."""

    @property
    def key(self) -> str: ...


@dataclass(frozen=True)
class Permissions:
    """The keys of one role, relative to the robot."""

    publishes: frozenset[str]
    subscribes: frozenset[str]
    serves: frozenset[str]
    asks: frozenset[str]


def permissions(role: Role) -> Permissions:
    """What a role may do, from the tables of topics and roles."""
    carried_out, followed = carried_out_by(role), (*role.acts, *role.watches)
    goals = {action: (keys.goal_request(action), keys.cancel_request(action), keys.result_request(action))
             for action in (*carried_out, *role.acts)}  # fmt: skip
    about = {f"@node/*/{each}" for each in (*ABOUT, *((SET,) if role.sets_parameters else ()))}
    exchanged = (*served_by(role), *(request for action in carried_out for request in goals[action]))
    heard = _keys(_exchanges(REQUESTS, ACTIONS)) if role.hears_requests else frozenset()
    return Permissions(
        publishes=_keys(written_by(role)) | _keys(_told_of(carried_out)) | _keys(_exchanges(exchanged, carried_out)),
        subscribes=_keys(role.reads) | _keys(_told_of(followed)) | heard,
        serves=_keys(served_by(role))
        | _keys(request for action in carried_out for request in goals[action])
        | {f"@node/{name}/{each}" for name in [role.node or "*"] for each in (*ABOUT, SET)},
        asks=_keys(role.asks) | _keys(request for action in role.acts for request in goals[action]) | about,
    )


def access_control(robots: Iterable[str]) -> dict[str, object]:
    """The router's `access_control`: one subject and its rules for each role, for these robots and no others."""
    names = tuple(robots)
    rules = {role.name: list(_rules(role, names)) for role in ROLES}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for each in rules.values() for rule in each],
        "subjects": [{"id": role.name, "cert_common_names": [role.name]} for role in ROLES],
        "policies": [{"subjects": [name], "rules": [str(rule["id"]) for rule in each]} for name, each in rules.items()],
    }


def _rules(role: Role, robots: tuple[str, ...]) -> Iterator[Rule]:
    may = permissions(role)

    def rule(what: str, flows: tuple[str, ...], messages: tuple[str, ...], wanted: Iterable[str]) -> Rule:
        full = [f"{robot}/{key}" for robot in robots for key in sorted(wanted)]
        return {"id": f"{role.name} {what}", "permission": "allow", "flows": list(flows), "messages": list(messages),
                "key_exprs": full}  # fmt: skip

    written, heard = _with_advanced(may.publishes), _with_advanced(may.subscribes)
    yield rule("publishes", IN, ("put", "reply"), written)
    yield rule("is told who listens", OUT, ("declare_subscriber",), written)
    yield rule("keeps what it wrote", IN, ("declare_queryable", "liveliness_token"), _advanced(may.publishes))
    yield rule("is asked for what it wrote", OUT, ("query",), _advanced(may.publishes))
    yield rule("listens", IN, ("declare_subscriber",), heard)
    yield rule("hears", OUT, ("put", "reply"), heard)
    yield rule("asks for what it missed", IN, ("query", "liveliness_query", "declare_liveliness_subscriber"),
               _advanced(may.subscribes))  # fmt: skip
    yield rule("is told who writes", OUT, ("declare_queryable", "liveliness_token"), _advanced(may.subscribes))
    yield rule("serves", IN, ("declare_queryable", "reply"), may.serves)
    yield rule("is asked", OUT, ("query",), may.serves)
    yield rule("asks", IN, ("query",), may.asks)
    yield rule("is answered", OUT, ("declare_queryable", "reply"), may.asks)
    yield rule("lives", IN, ("liveliness_token",), _names(role))
    yield rule("is told who lives", OUT, ("liveliness_token",), TOKENS)
    yield rule("asks who lives", IN, ("liveliness_query", "declare_liveliness_subscriber"), TOKENS)
    yield {"id": f"{role.name} asks which robots live", "permission": "allow", "flows": list(IN),
           "messages": ["liveliness_query"], "key_exprs": [f"*/{ALIVE}/*"]}  # fmt: skip
    if not role.node:
        yield rule("bears no service's name", IN, ("liveliness_token", "declare_queryable", "reply"), _reserved()) | {
            "permission": "deny"
        }


def _keys(declared: Iterable[Keyed]) -> frozenset[str]:
    return frozenset(each.key for each in declared)


def _told_of(actions: Iterable[keys.AnyAction]) -> Iterator[Keyed]:
    for action in actions:
        yield keys.feedback_topic(action)
        yield keys.status_topic(action)


def _exchanges(requests: Iterable[AnyRequest], actions: Iterable[keys.AnyAction]) -> Iterator[Keyed]:
    """What the servers of requests and actions say of what they were asked, and how it ended."""
    for request in requests:
        if request.recorded:
            yield exchange_topic(request)
    for action in actions:
        yield exchange_topic(keys.goal_request(action))
        yield exchange_topic(keys.cancel_request(action))
        yield keys.ended_topic(action)
        yield from _told_of([action])


def _advanced(wanted: Iterable[str]) -> frozenset[str]:
    return frozenset(f"{key}/{ADVANCED}" for key in wanted)


def _with_advanced(wanted: frozenset[str]) -> frozenset[str]:
    return wanted | _advanced(wanted)


def _names(role: Role) -> tuple[str, ...]:
    return (f"@id/{role.node}/*", f"{ALIVE}/{role.node}") if role.node else TOKENS


def _reserved() -> Iterator[str]:
    """The keys by which a node has the name of a service."""
    for name in SERVICES:
        yield from (f"@id/{name}/*", f"{ALIVE}/{name}", f"@node/{name}/**")
