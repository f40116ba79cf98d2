"""The link to the device in words: how old its figures are, and why the device cannot be used, and since when."""

from __future__ import annotations

from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.reasons import Reason, because, plain

OLD = 2.0  # [s] of a round trip, beyond which it says nothing of the link as it is; it is measured twice a second


def is_old(age: float) -> bool:
    """True if a round trip that was measured `age` [s] ago is shown with its age."""
    return age > OLD


def round_trip(time: float, age: float) -> Reason:
    """A round trip of `time` [s], and where that is old, that it was measured `age` [s] ago."""
    return because("link.round_trip.old", time=time, age=age) if is_old(age) else because("link.round_trip", time=time)


def state_round_trip(state: DeviceState, more_age: float = 0.0) -> Reason:
    """The round trip of a state that came `more_age` [s] ago."""
    if not state.is_round_trip_of_wire:
        return because("link.round_trip.unmeasured")
    return round_trip(state.round_trip, state.round_trip_age + more_age)


def state_round_trip_text(state: DeviceState, more_age: float = 0.0) -> str:
    """As `state_round_trip`, `more_age` in [s], in a sentence."""
    return str(state_round_trip(state, more_age))


def deaf_for(status: DeviceStatus, now: int) -> float:
    """[s] for which the device has not heard at `now` [ns UNIX]; 0 while it hears."""
    return max(1.0, (now - status.deaf_since) * 1e-9) if status.deaf_since else 0.0


def why_not_usable(status: DeviceStatus, now: int) -> Reason:
    """Why the device is not usable at `now` [ns UNIX], with how long it has not received anything."""
    why = status.why or (plain(status.reason) if status.reason else because("device.unexplained"))
    deaf = deaf_for(status, now)
    return because("device.for_time", why, time=deaf) if deaf else why


def warning_of(status: DeviceStatus) -> Reason | None:
    """What a person has to mend though the device is usable; None where there is nothing."""
    return status.warning_why or (plain(status.warning) if status.warning else None)


def reason_text(status: DeviceStatus, now: int) -> str:
    """As `why_not_usable`, in a sentence."""
    return str(why_not_usable(status, now))


def why_offline(status: DeviceStatus, now: int) -> Reason:
    """As `why_not_usable`, of a device that is offline or, where its states arrive, not usable."""
    return because("device.is_not_usable" if status.speaks else "device.is_offline", why_not_usable(status, now))


def offline_word(speaks: bool) -> str:
    """What a device is that is not online."""
    return "not usable" if speaks else "offline"
