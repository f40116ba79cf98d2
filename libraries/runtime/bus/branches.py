"""The branches of the keys that many may use: who writes, asks or lives there stands in the key.

A principal is who a session is by its certificate: the common name, `<role>` or `<role>.<host>`, and `local` where the
router asks for none. The router's access control lets a principal use its own branch alone, so that the key says who
speaks (`libraries/runtime/permissions.py`); what a message or a request says of itself is not needed for it.
"""

from __future__ import annotations

import re

from gemelo.schemas.roles import BY_EVERY_NODE, BY_HAND, ROLE_OF_NODE, ROLES

NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")  # of a node
PRINCIPAL = re.compile(r"[a-z0-9][a-z0-9_-]*(?:\.[a-z0-9][a-z0-9_-]*)?")
LOCAL = "local"  # the principal of a session without a certificate
# Zenoh recovers what a reader has missed only of keys without a chunk that begins with `@` (1.10.2): no topic has one
# on the network, where `@request/plan` is `request/plan`.
BY, FROM = "by", "@from"

_OF_SERVICES = frozenset(role.name for role in ROLES if role.node)
_OF_MANY = frozenset(topic.key for topic in (*BY_EVERY_NODE, *BY_HAND))


def address_of(principal: str, node: str) -> str | None:
    """The address of a node of `principal`; None where the principal may not bear that name, or one is no name.

    That is the node's name, and `principal/name` where a certificate makes it a person's or a program's.
    """
    if not (NAME.fullmatch(node) and PRINCIPAL.fullmatch(principal)):
        return None
    if node in ROLE_OF_NODE or principal in _OF_SERVICES:
        return node if ROLE_OF_NODE.get(node) == principal else None
    return node if principal == LOCAL else f"{principal}/{node}"


def branch_of(address: str) -> str:
    """`principal/name` of an address."""
    return address if "/" in address else f"{ROLE_OF_NODE.get(address, LOCAL)}/{address}"


def name_in(address: str) -> str:
    """The node's name in its address."""
    return address.rpartition("/")[2]


def principal_of(node: str, shown: str) -> str:
    """The principal of a node whose session shows a certificate of the common name `shown`, empty for none."""
    return shown or ROLE_OF_NODE.get(node, LOCAL)


def is_of_many(key: str) -> bool:
    """True if many nodes write under this key, each in its own branch."""
    return key in _OF_MANY


def written_under(key: str, principal: str, node: str) -> str:
    """The key under which a node writes what is read under `key`."""
    return f"{key}/{BY}/{principal}/{node}" if is_of_many(key) else key.removeprefix("@")


def read_under(key: str) -> str:
    """The key expression of all that is written under `key`."""
    return f"{key}/{BY}/*/*" if is_of_many(key) else key.removeprefix("@")


def writer_at(wire_key: str) -> str | None:
    """The address of who has written under `wire_key`, of a key of every node; None for nobody's branch."""
    principal, node = wire_key.rsplit("/", 2)[-2:]
    return address_of(principal, node)


def asked_under(key: str, principal: str) -> str:
    """The key under which `principal` asks for what is served as `key`."""
    return f"{key}/{FROM}/{principal}"


def served_under(key: str) -> str:
    """The key expression under which all are served who ask for `key`."""
    return f"{key}/{FROM}/*"


def asker_at(wire_key: str) -> str | None:
    """The principal that asks under `wire_key`; None for a key expression that is nobody's."""
    principal = wire_key.rpartition("/")[2]
    return principal if PRINCIPAL.fullmatch(principal) else None
