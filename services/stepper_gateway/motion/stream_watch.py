"""Eyes on streamed targets: a path is sent once the planner has found it free, with the stop behind it.

What is not free, or not answered, is not sent: the device plays what it has, which was free, and stops by that, 0.1 s
after the newest target. Where something is in the way, shorter ways towards the targets are tried, so that the arm
comes near to it, slower and slower, and stands clear of it.
"""

from __future__ import annotations

from collections import deque

from gemelo.schemas.planning import StreamPath, StreamVerdict
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import STREAM_PATHS
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.live_follower import Proposal, Way

PATIENCE = 0.5  # [s] without an answer, after which nobody watches; chosen: the arm brakes since 0.4 s by then
AT_REST = 3.0  # [s] the same before anything moves; chosen: a planner makes its shapes with the first path of a scene
FIRST_LATER = 0.006  # [s] that an answer takes, as long as none has come; chosen: two hops of the bus, and the looks
MOST_LATER = 0.03  # [s] chosen: a path that begins later follows too late
ANSWERS = 50  # of which the slow ones count; chosen: one to two seconds
SHORTER, LONGER = 0.25, 1.6  # times the share that was free; chosen: from a hundredth to all of it in ten targets
LEAST, MOST = 0.004, 0.9  # of a way that is not gone wholly; chosen: less than a step, and nearly all
TRIES = 3  # ways for one target; chosen: all of it, the share that was free, a shorter one


class StreamWatch:
    """Of one stream after the other: what waits for the planner's answer, and how far the way was free."""

    def __init__(self, device: GatewayDevice) -> None:
        self._device = device
        self._number = 0
        self._waiting: Proposal | None = None
        self._asked = 0.0  # [s] monotonic
        self._took: deque[float] = deque(maxlen=ANSWERS)  # [s] until an answer came
        self._share, self._try = MOST, 0

    @property
    def is_waiting(self) -> bool:
        """True if an answer is due."""
        return self._waiting is not None

    def begin(self) -> None:
        """Another stream."""
        self._waiting, self._share, self._try = None, MOST, 0

    def on_target(self) -> None:
        """A new target: all of the way to it is tried first."""
        self._try = 0

    @property
    def way(self) -> Way:
        """How the next path is to be made."""
        share = (1.0, self._share, SHORTER * self._share)[min(self._try, TRIES - 1)]
        slow = sorted(self._took)[int(0.9 * len(self._took))] if self._took else FIRST_LATER
        return Way(share, min(MOST_LATER, slow + 0.001))

    def ask(self, proposal: Proposal, moment: Moment) -> None:
        """Have the planner look at it."""
        self._number += 1
        self._waiting, self._asked = proposal, moment.monotonic
        device = self._device
        path = StreamPath(
            stamp=moment.unix,
            session=device.gateway_id,
            number=self._number,
            name=device.arm.joint_names,
            positions=proposal.positions(),
            margin=device.parameters.stream_margin,
        )
        device.out.publish(STREAM_PATHS, path)

    def answered(self, verdict: StreamVerdict, moment: Moment) -> Proposal | None:
        """The path that the verdict is about; None if it is about none that waits."""
        if verdict.session != self._device.gateway_id or verdict.number != self._number or self._waiting is None:
            return None
        proposal, self._waiting = self._waiting, None
        if proposal.version is not None:  # the first one of a scene takes longer
            self._took.append(moment.monotonic - self._asked)
        if verdict.free:
            self._share = MOST if self._try == 0 else max(LEAST, min(MOST, LONGER * self.way.share))
        else:
            self._try += 1
            self._share = max(LEAST, SHORTER * self._share) if self._try == TRIES else self._share
        return proposal

    @property
    def tries_again(self) -> bool:
        """True if a shorter way is left to try for the newest target."""
        return 0 < self._try < TRIES

    def unwatched(self, moment: Moment) -> Reason | None:
        """Why the stream may not go on: nobody has answered; None if that is not so."""
        if self._waiting is None:
            return None
        patience = AT_REST if self._waiting.version is None else PATIENCE
        if moment.monotonic - self._asked <= patience:
            return None
        self._waiting = None
        return because("target.unwatched", time=patience)


def obstructed(verdict: StreamVerdict) -> Reason:
    """What is in the way."""
    limit = verdict.limit
    cause = None if limit is None else limit.why or plain(limit.message)
    return because("target.obstructed", *(() if cause is None else (cause,)))
