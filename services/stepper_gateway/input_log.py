"""Log of the core's inputs, published twice a second: enough for `gemelo replay` to give the same output, to the byte.

The first messages wait until a recorder that starts together with the gateway listens: without the beginning the rest
is of no use.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import msgspec

from gemelo.schemas.device import GatewayInputs
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput, Given, Input, Reply, digest_of, packed
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Output

PERIOD = 0.5  # [s] between two messages; chosen: what a kill -9 can cost
HELD_BACK = 10.0  # [s] after the beginning until the first ones are published; chosen: a stack is up by then
LARGE = 256 * 1024  # [B] after which a message does not wait for its time; chosen: small beside what a router takes


class InputLog:
    """Has the core handle inputs, and keeps them until they are published."""

    def __init__(
        self, core: GatewayCore, began: BeganInput, moment: Moment, publish: Callable[[GatewayInputs], object]
    ) -> None:
        self._core, self._session, self._publish = core, began.session, publish
        self._encode = msgspec.msgpack.Encoder().encode
        self._began = moment.monotonic
        self._given: list[bytes] = []
        self._size, self._number = 0, 0
        self._first = moment  # of the inputs that wait
        self._waiting: deque[GatewayInputs] = deque()  # for a recorder that starts together with the gateway
        self.is_on = True
        self._add(began, moment, 0)

    def handle(self, given: Input, moment: Moment) -> tuple[Reply, list[Output]]:
        """As the core's own; an error of the core comes after its input has been published."""
        try:
            reply, outputs = self._core.handle(given, moment)
        except Exception:
            self._add(given, moment, 0)
            self.finish()
            raise
        if self.is_on:
            self._add(given, moment, digest_of(reply, outputs))
        return reply, outputs

    def step(self, moment: Moment, is_on: bool) -> None:
        """Publishes what is due. What was given while it was off is missing: the numbers of the messages say so."""
        if self.is_on and not is_on:
            self._number += 1
            self._given, self._size = [], 0
        self.is_on = is_on
        if self._given and moment.monotonic - self._first.monotonic >= PERIOD:
            self._close_message()
        if moment.monotonic - self._began >= HELD_BACK:
            self._publish_waiting()

    def finish(self) -> None:
        """Publishes everything."""
        if self._given:
            self._close_message()
        self._publish_waiting()

    def _add(self, given: Input, moment: Moment, digest: int) -> None:
        if not self._given:
            self._first = moment
        encoded = self._encode(Given(moment.unix, moment.monotonic, digest, given))
        self._given.append(encoded)
        self._size += len(encoded)
        if self._size >= LARGE:  # at once: so a message has at most one large input, and that much beside it
            self._close_message()

    def _close_message(self) -> None:
        self._waiting.append(
            GatewayInputs(
                stamp=self._first.unix, session=self._session, number=self._number, inputs=packed(self._given)
            )
        )
        self._number += 1
        self._given, self._size = [], 0

    def _publish_waiting(self) -> None:
        while self._waiting:
            self._publish(self._waiting.popleft())
