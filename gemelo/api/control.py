"""Control of the arm: who holds it, taking it and giving it back. Without a holder everybody may move the arm."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from gemelo.api import control_file
from gemelo.api.errors import Lost, Refused, why_of
from gemelo.api.session import Session
from gemelo.libraries.runtime import errors as runtime
from gemelo.libraries.runtime.clock import token
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.control import ControlAnswer, ControlGive, ControlJoin, ControlState, ControlTake
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.topics import CONTROL, CONTROL_GIVE, CONTROL_JOIN, CONTROL_TAKE

TO_REST = 15.0  # [s] that the arm may take to come to rest, where another moves it
TO_ANSWER = 2.0  # [s]
TO_BE_TOLD = 2.0  # [s] from the answer to the topic that says the same
MOVES = "moving start"  # the planner's check that the arm stands
REMEDY = "arm.take_control()"


@dataclass(frozen=True)
class HeldControl:
    """One hold of this connection."""

    secret: str
    epoch: int
    number: int


class Control:
    """Who alone may move the arm. `arm.take_control()` takes it; stop, hold and cancel are everybody's.

    >>> arm.control.held, arm.control.holder
    (False, '')
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._own: HeldControl | None = None
        self._joined = ""  # the secret of the hold that this node shares, of another process of this user
        self.shares = True  # False: takes no part in the hold of another process of this user

    @property
    def state(self) -> ControlState:
        """Everything that is known of it: the holder's name, node and host, since when, and who shares it.

        >>> arm.control.state.members
        ()
        """
        return self._session.newest(CONTROL)

    @property
    def held(self) -> bool:
        """True if somebody holds it: nobody else moves the arm then.

        >>> arm.control.held
        False
        """
        return self.state.held

    @property
    def holder(self) -> str:
        """The holder's name; empty if there is none.

        >>> with arm.take_control("ana"):
        ...     arm.control.holder
        'ana'
        """
        return self.state.name

    @property
    def is_mine(self) -> bool:
        """True if this connection has taken it and holds it still.

        >>> with arm.take_control():
        ...     arm.control.is_mine
        True
        """
        own, state = self._own, self.state
        return own is not None and state.held and (state.epoch, state.number) == (own.epoch, own.number)

    @property
    def may_move(self) -> bool:
        """True if this connection may move the arm: nobody holds control, or it is the holder's.

        >>> arm.control.may_move
        True
        """
        state = self.state
        return not state.held or self._session.node.address in state.members

    def take(self, name: str = "", *, force: bool = False) -> str:
        """Takes control as `name` (this node's, if left out) and returns its secret; see `Arm.take_control`.

        >>> secret = arm.control.take("ana")
        >>> arm.control.give()
        """
        node, secret = self._session.node, token(self._session.clock, 256)
        question = ControlTake(name=name or node.name[:40], client=node.token, secret=secret, force=force)
        answer = self._require(self._session.call(CONTROL_TAKE, question, TO_REST), "take")
        self._own = HeldControl(secret, answer.epoch, answer.number)
        self._session.changed()
        if not self._session.wait_for(lambda: self.is_mine, TO_BE_TOLD):
            self.require_kept()
        return secret

    def give(self) -> None:
        """Gives it back: everybody may move the arm. Raises `Refused` where this connection does not hold it.

        >>> arm.control.give()
        Traceback (most recent call last):
        gemelo.api.errors.Refused: refused: this connection does not hold control: nothing to give back
        """
        own, self._own = self._own, None
        if own is None:
            raise Refused(because("client.control.none"), check="control")
        self.give_with(own.secret)

    def give_with(self, secret: str) -> None:
        """Gives back the hold of another process, by its secret; for the command line.

        >>> arm.control.give_with(arm.control.take("ana"))
        """
        if self._own is not None and self._own.secret == secret:
            self._own = None
        self._require(self._session.call(CONTROL_GIVE, ControlGive(secret=secret), TO_ANSWER), "give")
        self._session.wait_for(lambda: not self.held, TO_BE_TOLD)

    def prepare(self) -> None:
        """Before every motion: shares the hold of this user on this host; raises `Refused` where an own one was lost.

        >>> arm.control.prepare()
        """
        if self._own is not None:
            self.require_kept()
        elif self.shares:
            session = self._session
            secret = shared_secret(session.description.name, session.deployment)
            if secret and secret != self._joined:
                join(session.node, secret)
            self._joined = secret

    def require_kept(self) -> None:
        """Raises `Refused` where this connection has taken control and holds it no more, until it takes or gives it.

        >>> with arm.take_control():
        ...     arm.control.require_kept()
        """
        if self._own is None or self.is_mine:
            return
        state = self.state
        anew, holder = remedy("take_control_anew"), {"name": state.name, "node": state.node, "host": state.host}
        lost = because("client.control.lost_to", anew, **holder) if state.held else because("client.control.lost", anew)
        raise Refused(lost, check="control", subject=state.name, remedy=REMEDY)

    def _require(self, answer: ControlAnswer, what: str) -> ControlAnswer:
        if not answer.accepted:
            why = why_of(answer)
            raise Refused(because("client.control.refused", why, what=what), check="control", reason=why)
        return answer


class Hold:
    """Control that was taken, as a context: it is given back at the end.

    >>> with arm.take_control("ana") as hold:
    ...     arm.move(named="ready").status.name
    'SUCCEEDED'
    """

    def __init__(self, control: Control) -> None:
        self._control = control

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """What is lost already need not be given back, and must not hide what has happened."""
        with suppress(Refused, Lost):
            self._control.give()

    def give(self) -> None:
        """As at the end of the context.

        >>> arm.take_control().give()
        """
        self._control.give()


@contextmanager
def named_where_another_moves(control: Control, robot: str) -> Iterator[None]:
    """A plan that is refused because the arm moves: where another holds control, `Refused` with that one's name."""
    try:
        yield
    except Refused as refused:
        if refused.check != MOVES or control.may_move:
            raise
        state = control.state
        clock = time.strftime("%H:%M:%S", time.gmtime(state.since // 1_000_000_000))
        reason = because(
            "client.control.moves", remedy("ask_or_force"),
            holder=state.name, robot=robot, clock=clock, node=state.node, host=state.host,
        )  # fmt: skip
        said = because("client.refused", reason)
        raise Refused(said, check="control", subject=state.name, reason=reason) from refused


def shared_secret(robot: str, deployment: Deployment) -> str:
    """The secret of the hold that a living process of this user has on this host; empty where there is none."""
    hold = control_file.read(control_file.path_of(robot, deployment))
    return "" if hold is None else hold.secret


def join(node: Node, secret: str) -> None:
    """Shares a hold; where that is refused the gateway refuses the motion by name, so nothing is said here."""
    with suppress(runtime.RequestRefused, runtime.NoAnswer, runtime.BusError):
        node.call(CONTROL_JOIN, ControlJoin(client=node.token, secret=secret), TO_ANSWER)


def join_shared(node: Node, robot: str, deployment: Deployment) -> None:
    """As `Control.prepare`, for a command that has a node alone."""
    if secret := shared_secret(robot, deployment):
        join(node, secret)
