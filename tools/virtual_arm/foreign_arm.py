"""A gateway in steps of virtual time before a board of an old dialect, which has no clock of its own to follow."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

from gemelo.tools.virtual_arm.gateway_driver import GatewayDriver, Moment, StepInput
from gemelo.tools.virtual_arm.virtual_arm import GATEWAY_ZERO, UNIX

PERIOD = 0.02  # [s] of the gateway's loop


class ForeignArm(GatewayDriver):
    """What its board and its wire do in a step is `_exchange`."""

    def __init__(self, step: float) -> None:
        """`step` [s] of virtual time."""
        super().__init__()
        self.now, self._step, self._beat = 0.0, step, 0.0

    @property
    def moment(self) -> Moment:
        return Moment(UNIX + round(self.now * 1e9), GATEWAY_ZERO + self.now)

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Lets `seconds` [s] pass, or less: until `until`; whether that came true."""
        end = self.now + seconds
        while self.now < end:
            if until is not None and until():
                return True
            self.now += self._step
            self._exchange()
            if self.now >= self._beat:
                self._beat += PERIOD
                self.handle(StepInput())
        return until is None or until()

    @abstractmethod
    def _exchange(self) -> None:
        """What comes and goes between gateway and board at this moment."""
