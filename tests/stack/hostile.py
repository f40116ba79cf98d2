"""A viewer that means harm, as a process of its own: `python -m tests.stack.hostile flood | stalled`.

`flood` sends 10,000 messages a second, half of them on keys of its own role and half on those of others, until it is
ended; each second it prints how many it has sent. `stalled` subscribes to everything and stops reading at the first.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from itertools import cycle

import zenoh

from gemelo.libraries.runtime.actions.keys import goal_request
from gemelo.libraries.runtime.bus.branches import asked_under, read_under, written_under
from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.permissions import permissions
from gemelo.schemas.roles import role
from gemelo.schemas.topics import FK, FOLLOW_JOINT_TRAJECTORY, JOINT_STATES, JOINT_TARGETS, LOG, PLAN, TOPICS
from gemelo.tools.bench.traffic import GOAL

RATE = 10_000  # [1/s]
BURST = 0.005  # [s]
SIZE = 200  # [bytes] of a message, at the least
OWN, FOREIGN = LOG.key, (JOINT_TARGETS.key, JOINT_STATES.key)
ASKED = (FK.key, PLAN.key, goal_request(FOLLOW_JOINT_TRAJECTORY).key)  # of which it may ask the first
NOTHING = zenoh.handlers.Callback(lambda reply: None, lambda: None, indirect=False)


def flood(session: zenoh.Session) -> None:
    payload = b"x" * SIZE + str(GOAL.goal_id).encode()
    own = written_under(OWN, "viewer", "hostile")
    foreign = (written_under(key, "operator", "hostile") for key in FOREIGN)
    puts: list[Callable[[], object]] = [partial(session.put, key, payload) for key in (own, *foreign, own)]
    asks: list[Callable[[], object]] = [
        partial(session.get, asked_under(key, "viewer"), NOTHING, payload=payload, timeout=0.5) for key in ASKED
    ]
    sends = cycle([*puts, *puts, *asks])
    began, sent, said = time.monotonic(), 0, 0
    while True:
        elapsed = time.monotonic() - began
        while sent < elapsed * RATE:
            next(sends)()
            sent += 1
        if elapsed > said + 1:
            said += 1
            print(sent, flush=True)
        time.sleep(BURST)


def stalled(session: zenoh.Session) -> None:
    may = permissions(role("viewer")).subscribes
    has_heard, never = threading.Event(), threading.Event()

    def on_sample(sample: zenoh.Sample) -> None:
        has_heard.set()
        never.wait()

    # Direct: else a thread of Zenoh's own reads on, until a queue for each key is full.
    reads = zenoh.handlers.Callback(on_sample, lambda: None, indirect=False)
    declared = [session.declare_subscriber(read_under(topic.key), reads) for topic in TOPICS if topic.key in may]
    has_heard.wait()
    print(len(declared), flush=True)
    never.wait()


def main(what: str) -> None:
    session = zenoh.open(client_config(load_deployment().router, "rm1"))
    {"flood": flood, "stalled": stalled}[what](session)


if __name__ == "__main__":
    main(sys.argv[1])
