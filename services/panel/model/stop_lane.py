"""A stop has a lane of its own: it waits for no other button's work, and nothing on its way waits for an answer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue

import gemelo
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.requests.client import PendingCall
from gemelo.schemas.device import DeviceCommandResponse, DeviceStopRequest, StopKind
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.services.panel.model.problems import Problem, problem_of

Call = PendingCall[DeviceStopRequest, DeviceCommandResponse]

TO_ANSWER = 3.0  # [s]


class StopLane:
    """Sends the stop where it is pressed, and follows it up in a thread that does nothing else."""

    def __init__(self, arm: gemelo.Arm, tell: Callable[[Problem], object], end_all: Callable[[], object]) -> None:
        """`end_all` is called in the lane's thread after each stop has been sent, or is on its way; it may wait."""
        self._arm, self._tell, self._end_all = arm, tell, end_all
        self._calls: SimpleQueue[tuple[Call | None] | None] = SimpleQueue()
        arm.node.is_served(DEVICE_STOP)  # from now on the first press need not find out who serves it
        self._thread = threading.Thread(target=self._run, name="stop", daemon=True)
        self._thread.start()

    def press(self) -> None:
        """Sends the stop; from any thread, and returns at once."""
        call: Call | None = None
        try:
            if self._arm.node.is_served(DEVICE_STOP):
                call = self._arm.node.ask(DEVICE_STOP, DeviceStopRequest(kind=StopKind.STOP), TO_ANSWER, lambda: None)
        except Exception as error:
            self._tell(problem_of(error))
        self._calls.put((call,))

    def close(self) -> None:
        """Ends the thread."""
        self._calls.put(None)
        self._thread.join(2.0)

    def _run(self) -> None:
        while (each := self._calls.get()) is not None:
            (call,) = each
            if call is None:  # looking for who serves it may take a while, and so may what `end_all` waits for
                threading.Thread(target=lambda: self._told(self._arm.stop), name="late stop", daemon=True).start()
            self._end_all()
            if call is not None:
                self._told(partial(self._follow, call))

    def _told(self, work: Callable[[], object]) -> None:
        try:
            work()
        except NoAnswer as error:
            self._tell(problem_of(gemelo.Lost(str(error))))
        except Exception as error:
            self._tell(problem_of(error))

    def _follow(self, call: Call) -> None:
        """Raises where the stop was refused, or nobody answers."""
        answer = call.response()
        if not answer.accepted:
            why = answer.why or plain(answer.reason)
            raise gemelo.Refused(because("client.command.refused", why, what="stop"), check="device", reason=why)
