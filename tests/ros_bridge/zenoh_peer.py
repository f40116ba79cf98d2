"""A router or a client of ROS on whatever zenoh its Python has; imports nothing of ours.

`python zenoh_peer.py router LOCATOR` runs until its input ends; `python zenoh_peer.py client LOCATOR JSON` prints what
it has received: the keys of a latched topic, of a topic at a rate and of a service are in the JSON.
"""

from __future__ import annotations

import json
import struct
import sys
import time

import zenoh
import zenoh.ext as zx

WAIT = 20.0  # [s] for what is latched
COUNTED = 4.0  # [s] in which messages are counted
ATTACHMENT = struct.pack("<qqB16s", 1, 1, 16, bytes(16))


def opened(**more: object) -> zenoh.Session:
    config = {"scouting": {"multicast": {"enabled": False}}, "timestamping": {"enabled": True}, **more}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))


def router(locator: str) -> None:
    with opened(mode="router", listen={"endpoints": [locator]}):
        print("listening", flush=True)
        sys.stdin.read()


def client(locator: str, keys: dict[str, str]) -> dict[str, object]:
    with opened(mode="client", connect={"endpoints": [locator]}) as session:
        replies = session.liveliness().get("@ros2_lv/**", timeout=5.0)
        tokens = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        latched: list[int] = []
        history, recovery = zx.HistoryConfig(detect_late_publishers=True), zx.RecoveryConfig(heartbeat=True)
        first = zx.declare_advanced_subscriber(
            session, keys["latched"], lambda sample: latched.append(len(bytes(sample.payload))),
            history=history, recovery=recovery,
        )  # fmt: skip
        end = time.monotonic() + WAIT
        while not latched and time.monotonic() < end:
            time.sleep(0.01)
        counted: list[int] = []
        second = session.declare_subscriber(keys["rate"], lambda sample: counted.append(len(bytes(sample.attachment))))
        time.sleep(COUNTED)
        answers = [
            len(bytes(reply.ok.payload))
            for reply in session.get(
                keys["service"], payload=bytes.fromhex("0001000000"), attachment=ATTACHMENT, timeout=10.0,
                target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE,
            )
            if reply.ok is not None
        ]  # fmt: skip
        first.undeclare()
        second.undeclare()
        return {"tokens": len(tokens), "latched": latched[:1], "rate": len(counted) / COUNTED,
                "attachments": sorted(set(counted)), "answers": answers}  # fmt: skip


if __name__ == "__main__":
    if sys.argv[1] == "router":
        router(sys.argv[2])
    else:
        print(json.dumps(client(sys.argv[2], json.loads(sys.argv[3]))))
