"""Permissions of each role for each key, and the access control of the router that enforces them.

Zenoh's access control looks at every message between router and session, in both directions: `ingress` is what a
session sends, `egress` what it is sent. What no rule allows is dropped without a word. A key of many has a branch for
each principal (bus/branches.py), which no other may use.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.bus.branches import asked_under, read_under, served_under, written_under
from gemelo.libraries.runtime.bus.identity import ALIVE, EACH, IDENTITY
from gemelo.schemas.roles import ROLES, Role, carried_out_by, served_by, written_by
from gemelo.schemas.topics import ACTIONS, REQUESTS, Request, exchange_topic

ADVANCED = "@adv/**"  # below an EVERY or LATCHED key: Zenoh's heartbeat, cache and token of its writer
ABOUT = ("info", "interfaces", "parameters/list")  # what every node answers about itself
SET = "parameters/set"
TOKENS = (f"{ALIVE}/*/*", EACH)
IN, OUT = ("ingress",), ("egress",)

Rule = dict[str, object]
AnyRequest = Request[Any, Any]


class Keyed(Protocol):
    """A topic, a request or an action."""

    @property
    def key(self) -> str: ...


@dataclass(frozen=True)
class Permissions:
    """The keys of one principal, relative to the robot and without the branches of who writes and asks."""

    publishes: frozenset[str]
    subscribes: frozenset[str]
    serves: frozenset[str]
    asks: frozenset[str]


def permissions(role: Role, principal: str = "") -> Permissions:
    """What a role may do, from the tables of topics and roles; `principal` is who has it, else called as the role."""
    carried_out, followed = carried_out_by(role), (*role.acts, *role.watches)
    goals = {action: (keys.goal_request(action), keys.cancel_request(action), keys.result_request(action))
             for action in (*carried_out, *role.acts)}  # fmt: skip
    about = {f"@node/*/*/{each}" for each in (*ABOUT, *((SET,) if role.sets_parameters else ()))}
    exchanged = (*served_by(role), *(request for action in carried_out for request in goals[action]))
    heard = _keys(_exchanges(REQUESTS, ACTIONS)) if role.hears_requests else frozenset()
    own = f"@node/{principal or role.name}/{role.node or '*'}"
    return Permissions(
        publishes=_keys(written_by(role)) | _keys(_told_of(carried_out)) | _keys(_exchanges(exchanged, carried_out)),
        subscribes=_keys(role.reads) | _keys(_told_of(followed)) | heard,
        serves=_keys(served_by(role))
        | _keys(request for action in carried_out for request in goals[action])
        | {f"{own}/{each}" for each in (*ABOUT, SET)},
        asks=_keys(role.asks) | _keys(request for action in role.acts for request in goals[action]) | about,
    )


def access_control(robots: Iterable[str], principals: Mapping[str, Iterable[str]] | None = None) -> dict[str, object]:
    """The router's `access_control`: a subject and its rules for each principal, for these robots and no others.

    `principals` are the common names of the certificates of a role, beside its own name, which is always one.
    """
    names, more = tuple(robots), principals or {}
    of = {principal: role for role in ROLES for principal in dict.fromkeys((role.name, *more.get(role.name, ())))}
    rules = {principal: list(_rules(role, principal, names)) for principal, role in of.items()}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for each in rules.values() for rule in each],
        "subjects": [{"id": principal, "cert_common_names": [principal]} for principal in rules],
        "policies": [{"subjects": [name], "rules": [str(rule["id"]) for rule in each]} for name, each in rules.items()],
    }


def _rules(role: Role, principal: str, robots: tuple[str, ...]) -> Iterator[Rule]:
    may = permissions(role, principal)

    def rule(what: str, flows: tuple[str, ...], messages: tuple[str, ...], wanted: Iterable[str]) -> Rule:
        full = [f"{robot}/{key}" for robot in robots for key in sorted(wanted)]
        return {"id": f"{principal} {what}", "permission": "allow", "flows": list(flows), "messages": list(messages),
                "key_exprs": full}  # fmt: skip

    own = {written_under(key, principal, role.node or "*") for key in may.publishes}
    written, shared = _with_advanced(own), set(map(read_under, may.publishes))  # shared: as its readers ask for it
    read = set(map(read_under, may.subscribes))
    served, answered = set(map(served_under, may.serves)), set(map(served_under, may.asks))
    yield rule("publishes", IN, ("put", "reply"), written)
    yield rule("is told who listens", OUT, ("declare_subscriber",), _with_advanced(shared))
    yield rule("keeps what it wrote", IN, ("declare_queryable", "liveliness_token"), _advanced(own))
    yield rule("is asked for what it wrote", OUT, ("query",), _advanced(shared))
    yield rule("listens", IN, ("declare_subscriber",), _with_advanced(read))
    yield rule("hears", OUT, ("put", "reply"), _with_advanced(read))
    yield rule("asks for what it missed", IN, ("query", "liveliness_query", "declare_liveliness_subscriber"),
               _advanced(read))  # fmt: skip
    yield rule("is told who writes", OUT, ("declare_queryable", "liveliness_token"), _advanced(read))
    yield rule("serves", IN, ("declare_queryable", "reply"), served)
    yield rule("is asked", OUT, ("query",), served)
    yield rule("asks", IN, ("query",), {asked_under(key, principal) for key in may.asks})
    yield rule("is answered", OUT, ("declare_queryable", "reply"), answered)
    yield rule("lives", IN, ("liveliness_token",), _own_tokens(role, principal))
    yield rule("is told who lives", OUT, ("liveliness_token",), TOKENS)
    yield rule("asks who lives", IN, ("liveliness_query", "declare_liveliness_subscriber"), TOKENS)
    yield {"id": f"{principal} asks which robots live", "permission": "allow", "flows": list(IN),
           "messages": ["liveliness_query"], "key_exprs": [f"*/{ALIVE}/*/*"]}  # fmt: skip


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


def _advanced(wanted: Iterable[str]) -> set[str]:
    return {f"{key}/{ADVANCED}" for key in wanted}


def _with_advanced(wanted: set[str]) -> set[str]:
    return wanted | _advanced(wanted)


def _own_tokens(role: Role, principal: str) -> tuple[str, ...]:
    """A wildcard within them is the principal's own affair: whoever reads tokens ignores it (bus/identity.py)."""
    node = f"{principal}/{role.node or '*'}"
    return f"{IDENTITY}/{node}/*", f"{ALIVE}/{node}"
