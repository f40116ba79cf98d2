"""Jogging by holding: what a browser says while a button is held becomes a steady stream of jog commands.

A browser that draws slowly says so late and unevenly; the stream goes on for `HELD` after its last word, and no longer,
so that a browser that has died or lost its network stops the arm.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import gemelo
from gemelo.schemas.planning import JogStatus
from gemelo.services.panel.model.problems import Problem, problem_of

HELD = 0.2  # [s] chosen: two frames of a browser that draws 10 times a second
PERIOD = 0.02  # [s] between two commands; the planner's own dead-man is 0.1 s
IDLE = 1.0  # [s]


@dataclass(frozen=True)
class JogWish:
    """The speeds of joints, or of the tool."""

    joints: Mapping[str, float] = field(default_factory=dict)  # [rad/s] or [m/s]
    twist: tuple[float, ...] = ()  # (6,) [m/s] and [rad/s]
    frame: str = ""  # along whose axes the tool moves; the base's if empty


class Jogging:
    """Holds for whoever speaks last; `release` and silence end it."""

    def __init__(self, arm: gemelo.Arm, tell: Callable[[Problem], object]) -> None:
        self._arm, self._tell = arm, tell
        self._news = threading.Condition()
        self._wish: JogWish | None = None
        self._heard = 0.0  # [s] monotonic
        self._is_open = True
        self.status: JogStatus | None = None  # what the planner says of this jog
        self._thread = threading.Thread(target=self._run, name="jogging", daemon=True)
        self._thread.start()

    @property
    def is_active(self) -> bool:
        return self._wish is not None

    def hold(self, wish: JogWish) -> None:
        """Says that a button is held now."""
        with self._news:
            self._wish, self._heard = wish, time.monotonic()
            self._news.notify_all()

    def release(self) -> None:
        """Ends it now, as Stop does."""
        with self._news:
            self._wish = None

    def close(self) -> None:
        """Ends the thread."""
        with self._news:
            self._wish, self._is_open = None, False
            self._news.notify_all()
        self._thread.join(2.0)

    def _run(self) -> None:
        while True:
            with self._news:
                while self._wish is None and self._is_open:
                    self._news.wait(IDLE)
                if not self._is_open:
                    return
                wish = self._wish
                if time.monotonic() - self._heard > HELD:
                    self._wish = wish = None
            if wish is not None:
                self._say(wish)
                time.sleep(PERIOD)

    def _say(self, wish: JogWish) -> None:
        try:
            if wish.joints:
                self.status = self._arm.jog(joints=wish.joints)
            else:
                self.status = self._arm.jog(twist=wish.twist, frame=wish.frame)
        except Exception as error:
            self.release()
            self._tell(problem_of(error))
