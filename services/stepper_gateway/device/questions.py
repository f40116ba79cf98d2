"""The questions for the device's clock: which are answered, for how long none is, and whether others ask it too."""

from __future__ import annotations

from collections import deque

from gemelo.services.stepper_gateway.links.frames import Sync, SyncReply
from gemelo.services.stepper_gateway.moment import Moment

# While answers are missing they are frequent: so a wire that loses most frames is told from a device that gets none.
LATE_ANSWER = 0.25  # [s] after which an answer is missing; chosen: longer than a slow network's round trip
DEAF_AFTER = 1.4  # [s] of questions without an answer; chosen: with the pause between two of them, below 2 s
LEAST_UNANSWERED = 4  # questions; chosen: more than one, as a pause of this loop is no deafness of the device
TWIN_SEEN = 1.5  # [s] that an answer to a stranger's question counts; chosen: three of its questions
MOST_STRANGE = 8  # such answers that are compared; chosen: some garbled ones between two true ones do not hide these
SAME_PACE = 0.1  # [s] by which the times of two questions differ by both clocks; chosen: a network's jitter
KEPT_QUESTIONS = 512  # of ours, which are no stranger's however late the answer; chosen: 15 s of the most frequent
QUESTIONS = 32  # that may be under way; chosen: 1 s of them at first, beyond which answers are late


class Questions:
    """Those of one gateway to one device."""

    def __init__(self) -> None:
        self._open: deque[int] = deque(maxlen=QUESTIONS)  # [us] SYNCs that may be answered
        self._asked: deque[int] = deque(maxlen=KEPT_QUESTIONS)  # [us] all of ours
        self._strange: deque[SyncReply] = deque(maxlen=MOST_STRANGE)  # to others
        self._twin_seen = -1.0e9  # [s] monotonic
        self._unanswered = 0  # SYNCs since the last answer
        self._unanswered_since = 0.0  # [s] monotonic, of the first of them
        self._deaf_since = 0  # [ns] UNIX time
        self.answered = -1.0e9  # [s] monotonic, when the device has answered a question last

    def begin_anew(self) -> None:
        """The link has come, or another boot: what has not been answered says nothing of it."""
        self._unanswered = self._deaf_since = 0

    def ask(self, boot_id: int, moment: Moment) -> Sync:
        """One more question, now."""
        self._open.append(moment.micros)
        self._asked.append(moment.micros)
        if self._unanswered == 0:
            self._unanswered_since = moment.monotonic
        self._unanswered += 1
        return Sync(boot_id=boot_id, t0=moment.micros)

    def is_open(self, reply: SyncReply, arrival_us: int) -> bool:
        """True if this may be the answer to an open question; another gateway's answers are noted."""
        if reply.t0 in self._open:
            return True
        if reply.t0 not in self._asked:
            self._on_strange_answer(reply, arrival_us * 1e-6)
        return False

    def on_answer(self, t0: int, arrival_us: int) -> None:
        """The question of `t0` [us] is answered."""
        self._open.remove(t0)
        self._unanswered, self._deaf_since, self.answered = 0, 0, arrival_us * 1e-6

    def is_late(self, now: float) -> bool:
        """True if an answer is missing at `now` [s] monotonic."""
        return self._unanswered > 0 and now - self._unanswered_since > LATE_ANSWER

    def is_deaf(self, now: float) -> bool:
        """True if at `now` [s] monotonic nothing that is asked has been answered for DEAF_AFTER: nothing arrives."""
        return self._unanswered >= LEAST_UNANSWERED and now - self._unanswered_since > DEAF_AFTER

    def deaf_since(self, moment: Moment) -> int:
        """[ns] UNIX time since when nothing is answered; 0 while it is. The same at every call until an answer."""
        if self.is_deaf(moment.monotonic) and not self._deaf_since:
            self._deaf_since = moment.unix_at(self._unanswered_since)
        return self._deaf_since

    def has_twin(self, now: float) -> bool:
        """True if at `now` [s] monotonic the device answers another gateway: what each sends would move the arm."""
        return now - self._twin_seen <= TWIN_SEEN

    def _on_strange_answer(self, reply: SyncReply, arrival: float) -> None:
        """An answer to somebody's question: the clock of a gateway goes on as the device's does, late as it may come.

        One answer may be forged or garbled, or be to the gateway before this one.
        """
        for before in self._strange:
            asked, taken = (reply.t0 - before.t0) * 1e-6, (reply.t1 - before.t1) * 1e-6
            if asked > 0.0 and 0.0 < taken <= TWIN_SEEN and abs(asked - taken) < SAME_PACE:
                self._twin_seen = arrival
        self._strange.append(reply)
