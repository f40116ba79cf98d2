"""Control of the arm: everybody may move it while nobody holds control, else the holder's nodes alone.

Knows neither the arm nor a clock: it is told whether the arm rests, and how long each token has been missing.
"""

from __future__ import annotations

import hashlib
import hmac
import time
from collections.abc import Mapping
from dataclasses import dataclass

from gemelo.schemas.control import ControlGive, ControlJoin, ControlState, ControlTake
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.schemas.system import LogLevel
from gemelo.services.stepper_gateway.control.clients import ControlClient, MotionCaller, client_of
from gemelo.services.stepper_gateway.goals.rejections import invalid
from gemelo.services.stepper_gateway.moment import Moment

MOST_NAME = 40  # characters of a holder's name; chosen: fits beside a button of the page
SECRET = (32, 128)  # characters of a secret, at least and at most; chosen: 128 bits in hexadecimal digits, and room
MOST_MEMBERS = 32  # nodes that share one hold; chosen: a person's terminals and scripts
GONE = 0.2  # [s] without its token until a holder counts as gone; chosen: a router that ends takes longer to be missed

Note = tuple[LogLevel, str]


@dataclass(frozen=True)
class Claim:
    """One who has asked for control, or holds it."""

    name: str
    client: ControlClient
    digest: bytes  # of the secret, which is not kept
    ticket: int  # of the request

    @property
    def words(self) -> str:
        """`ana (node cli-4711 on desk)`, for the log."""
        return f"{self.name} (node {self.client.node} on {self.client.host})"

    @property
    def values(self) -> dict[str, Value]:
        """Who that is, in a reason."""
        return {"name": self.name, "node": self.client.node, "host": self.client.host}


class ControlHolder:
    """One holder at a time; a claim waits until the arm rests."""

    def __init__(self, robot: str, epoch: int) -> None:
        self._robot, self._epoch, self._number = robot, epoch, 0
        self._holder: Claim | None = None
        self._since = Moment(0, 0.0)
        self._members: dict[str, ControlClient] = {}  # by the key of the token
        self._absence = 0.0  # [s] for which the holder's token has been missing
        self._was_given = False
        self._claim: Claim | None = None
        self._notes: list[Note] = []
        self._seen: tuple[object, ...] | None = None  # of what `state` says, when `has_changed` was asked last
        self.refused: list[tuple[int, Reason]] = []  # tickets of claims that came to nothing, and why
        self.granted: list[int] = []  # tickets of claims that were granted

    @property
    def watched(self) -> tuple[str, ...]:
        """Keys of the tokens whose absence counts."""
        claim = () if self._claim is None else (self._claim.client.key,)
        return tuple(dict.fromkeys((*self._members, *claim)))

    @property
    def number(self) -> int:
        """Of the present hold, or of the last."""
        return self._number

    def is_claimed_by(self, caller: MotionCaller) -> bool:
        """True if `caller` waits for control."""
        return self._claim is not None and self._claim.client.is_caller(caller)

    @property
    def is_gone(self) -> bool:
        """True if the holder's token has vanished, and control is not lost yet."""
        return self._holder is not None and self._absence > GONE

    @property
    def must_rest(self) -> Reason | None:
        """Why the arm has to come to rest before anything else, None if it need not."""
        if self._claim is not None:
            return because("control.taken", **self._claim.values)
        return because("control.holder_gone", **self._holder.values) if self._holder and self.is_gone else None

    def has_changed(self) -> bool:
        """True where `take_notes` or `state` may say something else than when this was asked last."""
        facts = (self._holder, self._claim, self.is_gone, self._was_given, self._number, *self._members.values())
        before, self._seen = self._seen, facts
        return bool(self._notes) or facts != before

    def state(self) -> ControlState:
        """What everybody may know, without a stamp."""
        why = self.must_rest
        about = ControlState(
            epoch=self._epoch, number=self._number, given=self._was_given, pending=str(why or ""), why=why
        )
        if (holder := self._holder) is None:
            return about
        return ControlState(
            epoch=self._epoch, number=self._number, held=True, name=holder.name,
            node=holder.client.node, host=holder.client.host, since=self._since.unix,
            members=tuple(member.address for member in self._members.values()), pending=about.pending, why=why,
        )  # fmt: skip

    def objection(self, caller: MotionCaller, moment: Moment) -> Reason | None:
        """Why `caller` may not move the arm, None if it may."""
        if self._claim is not None:
            return because("control.being_taken", robot=self._robot, **self._claim.values)
        if self._holder is None:
            return None
        if not any(member.is_caller(caller) for member in self._members.values()):
            return self._held_by(self._holder, moment)
        if self.is_gone:
            return because("control.holder_gone.anew", time=self._absence, **self._holder.values)
        return None

    def take(self, request: ControlTake, session: str, ticket: int, moment: Moment) -> Claim | None:
        """A claim that `grant` fulfils; None for the holder's own, repeated. Raises `GoalRejected`."""
        claim = Claim(_name(request.name), client_of(request.client, session), _digest(request.secret), ticket)
        if self._is_holders(claim.digest) and self._holder is not None and self._holder.client == claim.client:
            return None
        if not request.force:
            if self._claim is not None:
                raise invalid(because("control.take.being_taken", robot=self._robot, **self._claim.values))
            if self._holder is not None:
                raise invalid(self._held_by(self._holder, moment))
        self._drop_claim(because("control.take.forced", **claim.values))
        self._claim = claim
        return claim

    def join(self, request: ControlJoin, session: str) -> None:
        """One more node of the holder's; raises `GoalRejected`."""
        if not self._is_holders(_digest(request.secret)):
            raise invalid(self._not_held("control.join.others", "control.join.none"))
        client = client_of(request.client, session)
        if client.key not in self._members and len(self._members) >= MOST_MEMBERS:
            raise invalid(because("control.join.full", limit=MOST_MEMBERS))
        self._members[client.key] = client

    def give(self, request: ControlGive) -> None:
        """Everybody may move the arm; raises `GoalRejected`."""
        if not self._is_holders(_digest(request.secret)) or self._holder is None:
            raise invalid(self._not_held("control.give.others", "control.give.none"))
        self._notes.append((LogLevel.INFO, f"control: {self._holder.words} has given it back"))
        self._free()
        self._was_given = True

    def step(self, absences: Mapping[str, float], is_at_rest: bool, grace: float, moment: Moment) -> None:
        """Grants a claim and lets go of who is gone: neither before the arm rests.

        `absences` [s] by key of a token: for how long it has been missing; `grace` [s] that a holder may be.
        """
        if self._claim is not None and absences.get(self._claim.client.key, 0.0) > GONE:
            self._drop_claim(because("control.take.client_gone"))
        if self._claim is not None and is_at_rest:
            self._grant(self._claim, moment)
            return
        self._watch_members(absences, grace)
        if self._holder is None:
            return
        was_gone, self._absence = self.is_gone, absences.get(self._holder.client.key, 0.0)
        if self.is_gone and not was_gone:
            text = f"{self.must_rest}: the arm slows to rest; control is lost in {grace:g} s"
            self._notes.append((LogLevel.WARNING, f"control: {text}"))
        elif was_gone and not self.is_gone:
            self._notes.append((LogLevel.INFO, f"control: {self._holder.words} is back"))
        if self._absence > grace and is_at_rest:
            text = f"{self._holder.words} has lost it, gone for {self._absence:.1f} s: everybody may move the arm"
            self._notes.append((LogLevel.WARNING, f"control: {text}"))
            self._free()

    def take_notes(self) -> list[Note]:
        """What the log is to say of who has taken, given and lost control."""
        notes, self._notes = self._notes, []
        return notes

    def _grant(self, claim: Claim, moment: Moment) -> None:
        before, self._claim = self._holder, None
        self._holder, self._since, self._absence = claim, moment, 0.0
        self._number += 1
        self._members = {claim.client.key: claim.client}
        by_force = f", by force, from {before.words}" if before is not None else ""
        level = LogLevel.WARNING if before is not None else LogLevel.INFO
        self._notes.append((level, f"control: {claim.words} has taken it{by_force}"))
        self.granted.append(claim.ticket)

    def _drop_claim(self, reason: Reason) -> None:
        if self._claim is not None:
            self.refused.append((self._claim.ticket, reason))
            self._claim = None

    def _watch_members(self, absences: Mapping[str, float], grace: float) -> None:
        """A node that has ended leaves no name behind that another may bear after it."""
        holder = "" if self._holder is None else self._holder.client.key
        gone = [key for key in self._members if key != holder and absences.get(key, 0.0) > grace]
        for key in gone:
            del self._members[key]

    def _free(self) -> None:
        self._holder, self._absence, self._was_given = None, 0.0, False
        self._members.clear()

    def _is_holders(self, digest: bytes) -> bool:
        return self._holder is not None and hmac.compare_digest(digest, self._holder.digest)

    def _held_by(self, holder: Claim, moment: Moment) -> Reason:
        clock = time.strftime("%H:%M:%S", time.gmtime(self._since.unix // 1_000_000_000))
        age = moment.monotonic - self._since.monotonic
        about: dict[str, Value] = {"robot": self._robot, "clock": clock, "age": age, **holder.values}
        if self.is_gone:
            return because("control.held.gone", gone=self._absence, **about)
        return because("control.held", **about)

    def _not_held(self, by_others: str, by_none: str) -> Reason:
        """The code of the two that is so."""
        return because(by_none) if self._holder is None else because(by_others, **self._holder.values)


def _name(name: str) -> str:
    if not 0 < len(name) <= MOST_NAME or not name.isprintable() or not name.strip():
        shown = ascii(name[:MOST_NAME])
        raise invalid(because("control.name.unprintable", name=shown, count=len(name), limit=MOST_NAME))
    return name.strip()


def seal(secret: str) -> str:
    """What the inputs of the core, which are recorded, have in the place of a secret; empty for one that is none."""
    return _digest(secret).hex() if SECRET[0] <= len(secret) <= SECRET[1] else ""


def _digest(secret: str) -> bytes:
    least, most = SECRET
    if not least <= len(secret) <= most:
        raise invalid(because("control.secret.length", count=len(secret), least=least, most=most))
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()
