"""Control: who alone may move the arm, where somebody has taken that right; without a holder everybody may.

A secret proves that a process belongs to the holder. It stands in requests to the gateway alone, which are neither
recorded nor published, and in no answer.
"""

from __future__ import annotations

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason


class ControlState(Message, frozen=True, kw_only=True):
    """Who holds control; `epoch` and `number` together name one hold."""

    stamp: int = 0  # [ns] UNIX time of the gateway
    epoch: int = 0  # of the gateway's process: what an earlier one has said of control is void
    number: int = 0  # counts the holds of this epoch
    held: bool = False  # false: everybody may move the arm
    name: str = ""  # of the holder, as it calls itself
    node: str = ""  # that has taken control
    host: str = ""  # on which that node runs
    since: int = 0  # [ns] UNIX time of the gateway
    members: tuple[str, ...] = ()  # addresses of the nodes that may move the arm: the holder's, and who has its secret
    given: bool = False  # nobody holds it because the last holder has given it back, and not lost it
    pending: str = ""  # why nobody may move the arm at this moment, as a sentence; empty if somebody may
    why: Reason | None = None  # `pending` as data


class ControlTake(Message, frozen=True, kw_only=True):
    """A node asks for control; it is answered when the arm rests, where another moves it."""

    name: str = ""  # of the person or program, for people
    client: str = ""  # key of the node's liveliness token: control ends some time after it vanishes
    secret: str = ""  # chosen by the client, at least 32 characters
    force: bool = False  # also where another holds control


class ControlJoin(Message, frozen=True, kw_only=True):
    """A node of the holder's wants to move the arm too."""

    client: str = ""  # key of its liveliness token
    secret: str = ""  # the holder's


class ControlGive(Message, frozen=True, kw_only=True):
    """The holder gives control back: everybody may move the arm."""

    secret: str = ""  # the holder's


class ControlAnswer(Message, frozen=True, kw_only=True):
    """The gateway's answer to each of the three."""

    accepted: bool = False
    reason: str = ""  # why not: the holder, since when, from where, and the remedy
    epoch: int = 0  # of the hold, as in `ControlState`
    number: int = 0
    why: Reason | None = None  # `reason` as data
