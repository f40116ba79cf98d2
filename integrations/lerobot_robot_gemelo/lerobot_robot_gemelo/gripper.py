"""The gripper's own thread: its goal waits for two answers of the gateway, for which the loop has no time."""

from __future__ import annotations

import gemelo

CHANGE = 0.001  # [m] by which a target must differ from the last one to be a new goal
TO_END = 5.0  # [s] for the thread


class GripperThread:
    """Brings the gripper to the newest target; an older goal is cancelled for it."""

    def __init__(self, arm: gemelo.Arm) -> None:
        self._arm = arm
        self._wanted: float | None = None  # [m] what waits to be gone to
        self._newest: float | None = None  # [m] the last one that was asked for
        self._ended = False
        self._error: gemelo.Error | None = None
        self._thread = arm.node.clock.thread(self._run, "lerobot-gripper")
        self._thread.start()

    def want(self, opening: float) -> float:
        """Goes to `opening` [m] soon, and returns the target that holds now; raises why the last goal has failed."""
        error, self._error = self._error, None
        if error is not None:
            raise error
        if self._newest is None or abs(opening - self._newest) >= CHANGE:
            self._newest = self._wanted = opening
            self._arm.wake()
        return self._newest

    def close(self) -> None:
        """The gripper stays where it is."""
        self._ended = True
        self._arm.wake()
        self._arm.wait_for(lambda: not self._thread.is_alive(), TO_END)

    def _run(self) -> None:
        try:
            while True:
                self._arm.wait_for(self._has_news)
                wanted, self._wanted = self._wanted, None
                if self._ended or wanted is None:
                    return
                self._go(wanted)
        except gemelo.Error as error:  # the connection has ended
            self._error = error

    def _go(self, opening: float) -> None:
        try:
            self._arm.grip(opening, is_cancelled=self._has_news)
        except gemelo.Canceled:  # for a newer target, or by somebody else
            pass
        except gemelo.Error as error:
            self._error = error

    def _has_news(self) -> bool:
        return self._ended or self._wanted is not None
