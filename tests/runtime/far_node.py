"""One of two nodes on hosts of their own: says and hears a lot, and five times a second what it knows of the other.

`python -m tests.runtime.far_node OWN OTHER`, with the deployment of $GEMELO_CONFIG.
"""

from __future__ import annotations

import json
import sys
import time

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.schemas.topics import Delivery

KEYS, PAYLOAD = 12, 900  # [bytes]: more in a second than the socket of a link takes
PERIOD = 0.02  # [s]


def main(own: str, other: str) -> None:
    bus = ZenohBus(load_deployment().router, "rm1")
    known = {"other": False, "heard": 0, "wrong": 0}

    def on_arrival(arrival: Arrival) -> None:
        known["heard"] += 1
        known["wrong"] += arrival.payload.rstrip(b"-") != arrival.key.encode()

    for index in range(KEYS):
        bus.subscribe(f"{other}{index}", Delivery.LATEST, on_arrival, lambda missed: None)
    bus.declare_alive(f"@alive/local/{own}")
    bus.watch_alive(f"@alive/local/{other}", lambda is_there: known.update(other=is_there))
    said = [(f"{own}{index}".encode(), bus.publish(f"{own}{index}", "Text", Delivery.LATEST)) for index in range(KEYS)]
    for count in range(sys.maxsize):
        for key, publication in said:
            publication.put(key.ljust(PAYLOAD, b"-"))
        if count % 10 == 0:
            print(json.dumps(known | {"connected": bus.is_connected}), flush=True)
        time.sleep(PERIOD)


if __name__ == "__main__":
    main(*sys.argv[1:])
