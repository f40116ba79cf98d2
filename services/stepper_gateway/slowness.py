"""How slow the device plays because a person wants it: only that excuses a goal that ends late."""

from __future__ import annotations

from schemas.device import DeviceMode
from services.stepper_gateway.links.frames import State


class Slowness:
    """1 - time scale, as far as a hold or SPEED accounts for it; a starving queue is not excused."""

    def __init__(self) -> None:
        self.share = 0.0  # of the time that passes, by which a goal may end later

    def on_state(self, state: State, is_held: bool) -> None:
        """Take the time scale of a state; `is_held`: by a person's command."""
        slowness = 1.0 - state.time_scale / 32768.0
        if is_held:
            self.share = slowness
        elif state.mode != DeviceMode.RUN:
            self.share = 0.0
        else:
            # After a hold or a low speed it takes a while to be fast again, and is never slower than before.
            self.share = min(slowness, max(1.0 - state.speed / 1000.0, self.share))
