"""How far the gateway's idea of the device's clock is off, on quiet, spiky and sleepy networks, at 100 ppm of drift.

The exchanges are those of the gateway, twice a second, in virtual time; the device's clock is known there exactly.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator

from services.bench.figure import Figure, Goal, of_samples, quantile
from services.stepper_gateway.device.clock import ClockSync

UNIT = "us"
DRIFT = 100e-6  # of the device's clock
OFFSET = 123_456_789.0  # [us] between the two
PERIOD = 500_000  # [us] between two exchanges
LOOK = 20_000  # [us] between two looks at the error
SETTLING = 8_000_000  # [us] that is not counted
DURATION = 600_000_000  # [us]
GOAL = Goal(p99=500.0)  # half a slot
SEED = 20_261_121

Ways = tuple[float, float]  # [us] there and back
Network = Callable[[random.Random], Ways]


def quiet(rng: random.Random) -> Ways:
    """A good network: 0.5 to 1.5 ms each way."""
    return rng.uniform(500, 1500), rng.uniform(500, 1500)


def spiky(rng: random.Random) -> Ways:
    """The same, with 5 to 40 ms more on each tenth way."""
    there, back = quiet(rng)
    late = [rng.uniform(5_000, 40_000) if rng.random() < 0.1 else 0.0 for _ in range(2)]
    return there + late[0], back + late[1]


def modem_sleep(rng: random.Random) -> Ways:
    """A station that sleeps between two beacons of 102.4 ms hears late and answers at once."""
    return rng.uniform(1_000, 103_400), rng.uniform(1_000, 3_000)


NETWORKS: dict[str, Network] = {"quiet": quiet, "spiky": spiky, "modem sleep": modem_sleep}


def measure() -> Figure:
    found = {name: list(errors(network)) for name, network in NETWORKS.items()}
    others = {f"{name} p99": quantile(found[name], 0.99) for name in NETWORKS if name != "spiky"}
    note = "virtual time, 100 ppm, spiky network; the firmware switches Wi-Fi's power saving off"
    return of_samples(found["spiky"], UNIT, GOAL, others, note)


def errors(network: Network) -> Iterator[float]:
    """|error| [us] of the device's time, 50 times a second."""
    clock, rng = ClockSync(), random.Random(SEED)
    now = 0
    while now < DURATION:
        there, back = network(rng)
        t0, t3 = now, now + round(there + back)
        heard = round(device_time(now + there))
        clock.add(t0, heard, heard, t3)
        if now >= SETTLING:
            for look in range(t3, t3 + PERIOD, LOOK):
                yield abs(clock.device_time(look * 1e-6) - device_time(look))
        now += PERIOD


def device_time(ours: float) -> float:
    """[us] of the device's clock at an instant of ours [us]."""
    return ours * (1.0 + DRIFT) + OFFSET
