"""The errors between nodes; every text is a sentence for a person."""

from __future__ import annotations

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, plain

TOO_LARGE = "too large"  # the kind of a refusal of what no receiver would take


class BusError(ReasonedError):
    """The bus cannot be used: no router, a name that is taken, a bus that is closed."""


class NodeNameTaken(BusError):
    """Another living node has this name."""


class RequestRefused(Exception):
    """A server would not do what was requested; raised by handlers, and again at the client."""

    def __init__(self, message: Reason | str, kind: str = "refused") -> None:
        super().__init__(str(message))
        self.kind = kind  # as in `Failure.kind`
        self.reason = message if isinstance(message, Reason) else plain(message)


class GoalRefused(RequestRefused):
    """An action's server did not accept the goal; `code` is the action's own."""

    def __init__(self, code: int, reason: str, why: Reason | None = None) -> None:
        """`why` is the same as data, where the server says it so."""
        super().__init__(why or reason)
        self.code = code


class NoAnswer(ReasonedError):
    """Nobody serves the request, or the answer did not come in time."""


class ServerLost(ReasonedError):
    """The server of a goal fell silent or forgot the goal; what became of the motion is not known."""
