"""One script's connection: a node whose loop runs in a thread of its own, so that what is asked is always fresh."""

from __future__ import annotations

import os
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from typing import TYPE_CHECKING, Any, TypeVar

from gemelo.api.errors import Error, Lost, Refused, reason_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime import errors as runtime
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.client import PendingCall
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.topics import Request, Topic

if TYPE_CHECKING:
    from gemelo.libraries.runtime.node_clock import NodeClock

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

PATIENCE = 2.0  # [s] for the first message of a topic, and for one that is late
ON_ITS_WAY = 0.3  # [s] that a message may be which was measured before the last change
IDLE_RATE = 1.0  # [Hz] of the thread's own step, which does nothing: messages wake it
CLOSING = 5.0  # [s] that the thread may take to end: one that outlives Python aborts the process
_numbers = count(1)


class Session:
    """The node, its thread, and the newest message of every topic that was asked for. Any thread may use it."""

    def __init__(self, deployment: Deployment, description: ArmDescription, node: Node) -> None:
        """Takes over a `node` that does not spin yet, and closes it in the end."""
        self.deployment, self.description, self._node = deployment, description, node
        self.clock = node.clock
        self.news = self.clock.condition()  # notified after every message that was handled
        self._latest: dict[str, Latest[Any]] = {}
        self._changed = 0.0  # [s] monotonic: what is asked from now on must have been heard after this
        self._changed_unix = 0  # [ns] the same moment, after which it should also have been measured
        self._clocks: dict[str, NodeClock] = {}  # by the name of the node
        self._pid = os.getpid()
        self._failure: BaseException | None = None
        self._is_closed = False
        self._thread: threading.Thread | None = None  # in virtual time whoever waits runs the node
        if self.clock.is_virtual:
            node.begin(rate=IDLE_RATE)
        else:
            self._thread = threading.Thread(target=self._run, name=self._node.name, daemon=True)
            self._thread.start()

    @property
    def node(self) -> Node:
        """The node, if it can be used from here; raises `Error` in a forked process, `Lost` after its end."""
        if os.getpid() != self._pid:
            raise Error(because("client.forked", process=self._pid))
        if self._failure is not None:
            raise Lost(because("lost.connection.ended", error=str(self._failure))) from self._failure
        if self._is_closed or (self._thread is not None and not self._thread.is_alive()):
            raise Lost(because("lost.connection.closed"))
        return self._node

    def latest(self, topic: Topic[M], handle: Callable[[M], object] | None = None) -> Latest[M]:
        """The newest message of `topic`, heard from the first call on; `handle` is called with every one of them."""
        node = self.node
        if topic.key not in self._latest:
            latest = self._latest[topic.key] = Latest(topic, self.clock)

            def on_message(message: M) -> None:
                with self.news:
                    latest.on_message(message)
                    if handle is not None:
                        handle(message)
                    self.news.notify_all()

            node.subscribe(topic, on_message)
        return self._latest[topic.key]

    def newest(self, topic: Topic[M]) -> M:
        """A message that came after the last motion or command, not older than its rate allows; raises `Lost`."""
        self.clock.look()
        latest = self.latest(topic)

        def is_fresh() -> bool:
            return not latest.is_stale and latest.age() < max(0.0, self.clock.monotonic() - self._changed)

        def is_there() -> bool:
            return latest.message is not None if topic.rate is None else is_fresh()

        def was_measured_since() -> bool:
            stamp = getattr(latest.message, "stamp", None)
            if not is_there() or stamp is None:
                return is_there()
            measured = clock.to_own(stamp)
            return measured is not None and measured >= self._changed_unix

        if topic.rate is not None and self._changed:
            clock = self._clock_of(topic.writer)
            self.wait_for(was_measured_since, ON_ITS_WAY)  # not for ever: it came after the change in any case
        if not self.wait_for(is_there, PATIENCE) or latest.message is None:
            raise Lost(because("lost.topic", remedy("list_nodes"), topic=topic.key, time=PATIENCE, writer=topic.writer))
        return latest.message

    def _clock_of(self, writer: str) -> NodeClock:
        """The clock of the node that stamps a topic."""
        from gemelo.libraries.runtime.node_clock import NodeClock  # for what is read after a change alone

        node = self.node
        with self.news:
            if writer not in self._clocks:
                self._clocks[writer] = NodeClock(node, writer)
            return self._clocks[writer]

    def changed(self) -> None:
        """Something has moved or was switched: what was heard before is no longer fresh."""
        self._changed, self._changed_unix = self.clock.monotonic(), self.clock.unix()

    def notify(self) -> None:
        """Wakes who waits; from any thread."""
        with self.news:
            self.news.notify_all()

    def wait_for(
        self, is_so: Callable[[], bool], timeout: float | None, on_news: Callable[[], None] | None = None
    ) -> bool:
        """Sleeps until `is_so()`, looking after every message; False after `timeout` [s]. `on_news` runs in between."""
        if self._node.is_in_turn or (self._thread is not None and threading.current_thread() is self._thread):
            raise Error(because("client.waits_in_a_handler"))
        end = None if timeout is None else self.clock.monotonic() + timeout
        while True:
            with self.news:
                if is_so():
                    return True
                left = 1.0 if end is None else end - self.clock.monotonic()
                if left <= 0.0:
                    return False
                if on_news is None:
                    self.news.wait_for(is_so, min(left, 1.0))
                else:
                    self.news.wait(min(left, 1.0))
            self.node  # noqa: B018 raises where the connection has ended
            if on_news is not None:
                on_news()

    def call(self, request: Request[Q, R], question: Q, timeout: float) -> R:
        """The answer; raises `Refused` with the server's reason, or `Lost` where there is none within `timeout` [s]."""
        with _as_own_errors():
            return self.node.call(request, question, timeout)

    def ask(self, request: Request[Q, R], question: Q, timeout: float) -> PendingCall[Q, R]:
        """Sends a question whose answer is awaited by `wait_for`, again after an interrupt too; raises `Lost`.

        `timeout` [s]: after it the call is over without an answer.
        """
        with _as_own_errors():
            return self.node.ask(request, question, timeout, self.notify)

    def close(self) -> None:
        """Leaves the bus; may be called twice."""
        if os.getpid() == self._pid:
            self._is_closed = True
            self._node.stop()
            if self._thread is not None and threading.current_thread() is not self._thread:
                self._thread.join(CLOSING)
            self._node.close()

    def _run(self) -> None:
        try:
            self._node.spin(rate=IDLE_RATE)
        except BaseException as error:
            self._failure = error
        self.notify()


def open_node(deployment: Deployment, robot: str, name: str = "") -> Node:
    """A node on the robot's bus, named after the script if no `name` is given; raises `Lost` where it cannot be."""
    with _as_own_errors():
        return Node(name or _node_name(), deployment, robot=robot, log_level="warning")


def answer_of(call: PendingCall[Q, R]) -> R:
    """The answer that has come; raises `Refused` with the server's reason, or `Lost` where there is none."""
    with _as_own_errors():
        return call.response()


@contextmanager
def _as_own_errors() -> Iterator[None]:
    """Raises the errors of the runtime as `Refused` and `Lost`."""
    try:
        yield
    except runtime.RequestRefused as error:
        raise Refused(reason_of(error)) from error
    except (runtime.NoAnswer, runtime.BusError) as error:
        raise Lost(reason_of(error)) from error


def _node_name() -> str:
    """The script's name and process, and a number from its second connection on: as `pick_and_place-4711`."""
    script = re.sub(r"[^a-z0-9]+", "_", os.path.basename(sys.argv[0] if sys.argv else "").removesuffix(".py").lower())
    number = next(_numbers)
    return f"{script.strip('_') or 'python'}-{os.getpid()}{f'-{number}' if number > 1 else ''}"
