"""Names a person may have mistyped."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from services.cli.exits import CommandError, usage


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like `name`, or None if none is."""
    known = list(known)
    close = get_close_matches(name, known, n=1, cutoff=0.5)
    if close:
        return close[0]
    inside = [candidate for candidate in known if name and name in candidate]
    return inside[0] if inside else None


def unknown(kind: str, name: str, known: Iterable[str]) -> CommandError:
    """`no topic "joint_state": did you mean "joint_states"?`, or the list of what there is."""
    known = sorted(known)
    guess = nearest(name, known)
    if guess is not None:
        return usage(f'no {kind} "{name}": did you mean "{guess}"?')
    return usage(f'no {kind} "{name}": there is {", ".join(known) if known else "none at all"}')
