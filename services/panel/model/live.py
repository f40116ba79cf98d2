"""Live sliders: while the switch is on the arm follows the goal's joint values, jogging: limits and obstacles slow it.

The speed is proportional to what is missing, up to `SHARE` of the joint's limit.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import gemelo
from gemelo.services.panel.model.jogging import Jogging, JogWish
from gemelo.services.panel.model.readings import BusReadings

PERIOD = 0.02  # [s] between two speeds
GAIN = 4.0  # [1/s] chosen: with the 0.1 s from a jog command to its motion it does not overshoot
SHARE = 0.5  # chosen: of a joint's velocity limit
NEAR = {"rad": 0.001, "m": 0.0002}  # chosen: what is missing at the end, about what a pixel of a slider is


class LiveSliders:
    """Off at first, and after every Stop or refusal."""

    def __init__(self, arm: gemelo.Arm, jogging: Jogging, bus: BusReadings) -> None:
        self._joints, self._jogging, self._bus = arm.description.joints, jogging, bus
        self._news = threading.Condition()
        self._target: Mapping[str, float] = {}
        self._is_open = True
        self.is_on = False
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()

    def switch(self, on: bool) -> None:
        """Switched on, nothing moves until a slider does."""
        with self._news:
            self._target, self.is_on = {}, on
            self._news.notify_all()

    def follow(self, joints: Mapping[str, float]) -> None:
        """The target from now on, [rad] or [m] by joint; nothing while it is off."""
        with self._news:
            if self.is_on:
                self._target = dict(joints)
                self._news.notify_all()

    def close(self) -> None:
        """Ends the thread; the arm brakes."""
        with self._news:
            self.is_on, self._is_open = False, False
            self._news.notify_all()
        self._thread.join(2.0)

    def _run(self) -> None:
        while True:
            with self._news:
                while self._is_open and not (self.is_on and self._target):
                    self._news.wait()
                if not self._is_open:
                    return
                target = self._target
            speeds = self.speeds(self._bus.joints, target)
            if any(speeds.values()):
                self._jogging.hold(JogWish(joints=speeds))
            else:
                self._arrived(target)
            time.sleep(PERIOD)

    def _arrived(self, target: Mapping[str, float]) -> None:
        """Until a slider moves again others may lead the arm, and it is not drawn back."""
        self._jogging.release()
        with self._news:
            if self._target is target:
                self._target = {}

    def speeds(self, measured: Mapping[str, float], target: Mapping[str, float]) -> dict[str, float]:
        """[rad/s] or [m/s] by joint from `measured` to `target` [rad] or [m]; all 0 where everything is near enough."""
        speeds: dict[str, float] = {}
        for joint in self._joints:
            missing = joint.clamp(target.get(joint.name, measured[joint.name])) - measured[joint.name]
            most = SHARE * joint.velocity
            near = abs(missing) < NEAR[joint.unit]
            speeds[joint.name] = 0.0 if near else min(max(GAIN * missing, -most), most)
        return speeds
