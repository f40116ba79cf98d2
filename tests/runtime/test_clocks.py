"""Hosts whose clocks differ: what was said before a reader came stays unsaid, and what is said after reaches it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.schemas.topics import Delivery
from tests.runtime.support import ROOT, until

SHIFTED_CLOCK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>
int clock_gettime(clockid_t id, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int code = real(id, now);
    if (id == CLOCK_REALTIME) now->tv_sec += atoi(getenv("CLOCK_AHEAD"));
    return code;
}
"""
READER = """
import sys, time
import zenoh
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.topics import Delivery
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import client_config
section = RouterSection(port=int(sys.argv[1]))
bus, beside = ZenohBus(section, "rm1"), zenoh.open(client_config(section, "rm1"))
say = lambda arrival: print(arrival.payload.decode(), flush=True)
bus.subscribe("device/events", Delivery.EVERY, say, lambda lost: print("lost", lost, flush=True))
# The writer's heartbeat says what a reader might have missed, which is then recovered.
beats = beside.declare_subscriber("device/events/@adv/pub/**", lambda beat: print("heartbeat", flush=True))
print(f"joined {time.time()}", flush=True)
sys.stdin.read()
beside.close()
bus.close()
"""


@pytest.fixture(scope="module")
def shifted_clock(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("clock")
    source, library = folder / "clock.c", folder / "clock.so"
    source.write_text(SHIFTED_CLOCK)
    subprocess.run(["c++", "-x", "c", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return library


@pytest.mark.parametrize("ahead", [-5, 0, 5])
def test_a_late_reader_hears_what_is_new_and_nothing_old_whatever_its_clock_says(shifted_clock, router, ahead):
    writer = ZenohBus(router.deployment.router, "rm1")
    events = writer.publish("device/events", "DeviceEvent", Delivery.EVERY)
    for index in range(3):
        events.put(b"old %d" % index)
    said: list[str] = []
    with subprocess.Popen(
        [sys.executable, "-c", READER, str(router.port)], cwd=ROOT, text=True,
        env=os.environ | {"LD_PRELOAD": str(shifted_clock), "CLOCK_AHEAD": str(ahead)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as reader:  # fmt: skip
        threading.Thread(target=lambda: said.extend(iter(reader.stdout.readline, "")), daemon=True).start()
        assert until(lambda: said.count("heartbeat\n") == 2, 60.0), said  # recovered by now
        (joined,) = (float(line.split()[1]) for line in said if line.startswith("joined"))
        assert abs(joined - time.time() - ahead) < 2.0, "the reader's clock is not shifted"
        events.put(b"new")
        events.put(b"last")
        assert until(lambda: "last\n" in said), said
        assert [line for line in said if line.split()[0] not in ("joined", "heartbeat")] == ["new\n", "last\n"]
        reader.stdin.close()
    writer.close()


def heard_by(reader: ZenohBus) -> list[bytes]:
    """What a reader that joins now hears from now on."""
    heard: list[bytes] = []
    reader.subscribe("device/events", Delivery.EVERY, lambda arrival: heard.append(arrival.payload), lambda lost: None)
    return heard


def test_a_writer_that_starts_anew_is_heard_from_its_first_message(router):
    earlier, reader, first = (ZenohBus(router.deployment.router, "rm1") for _ in range(3))
    heard_earlier = heard_by(earlier)
    before = first.publish("device/events", "DeviceEvent", Delivery.EVERY)
    for _ in range(5):
        before.put(b"before it joined")
    # Until then the router does not know the writer, and nobody could ask it what it has said so far.
    assert until(lambda: len(heard_earlier) == 5), heard_earlier
    heard = heard_by(reader)
    before.put(b"of the first")
    assert until(lambda: heard == [b"of the first"]), heard
    first.close()
    second = ZenohBus(router.deployment.router, "rm1")
    second.publish("device/events", "DeviceEvent", Delivery.EVERY).put(b"of the second")
    assert until(lambda: heard == [b"of the first", b"of the second"]), heard
    for bus in (earlier, reader, second):
        bus.close()
