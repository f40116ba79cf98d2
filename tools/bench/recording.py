"""Figures of recordings: the cost of recording and of a black box, and how fast a recording is replayed."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import msgspec

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import Incident
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.device import DeviceFault, DeviceMode, DeviceState
from gemelo.schemas.topics import DEVICE_STATE
from gemelo.services.logger.black_box import BlackBox, write_black_box
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples
from gemelo.tools.bench.latency import swing
from gemelo.tools.bench.stack import Running, Stacks, cpu_seconds, families
from gemelo.tools.replay.main import SERVICES, replay, text_of
from gemelo.tools.replay.make_recordings import FOLDER

SETTLE = 3.0  # [s] of motion that are not counted
WINDOW, WINDOWS = 5.0, 4  # [s]
LOGGER = "logger"
HEARD = 20.0  # [s] of motion that a minute is made of
SECOND = 1_000_000_000  # [ns]
BLACKBOX_GOAL = FigureGoal(p99=2.0)  # [% of one core]


def record_cpu_percent(stacks: Stacks) -> Figure:
    """CPU time [% of one core] of the logger, which records everything that is said while the arm moves."""
    running = stacks.any_broker()
    processes = families(running.stack)[LOGGER]
    swing(running, SETTLE)
    samples = []
    for _ in range(WINDOWS):
        before, began = cpu_seconds(processes), time.monotonic()
        swing(running, WINDOW)
        samples.append((cpu_seconds(processes) - before) / (time.monotonic() - began) * 100.0)
    return of_samples(samples, note=f"{WINDOWS} windows of {WINDOW:g} s of streamed motion, every topic recorded")


def record_mb_per_hour(stacks: Stacks) -> Figure:
    """Growth [MB/h] of the logger's MCAP while the arm moves; an arm that stands sends no chunks and takes less."""
    running = stacks.any_broker()
    swing(running, SETTLE)
    file = _newest(running)
    samples = []
    for _ in range(WINDOWS):
        before, began = file.stat().st_size, time.monotonic()
        swing(running, WINDOW)
        samples.append((file.stat().st_size - before) / 1e6 / (time.monotonic() - began) * 3600.0)
    return of_samples(samples, note="zstd chunks, twice a second; with what Foxglove shows of frames, scene and log")


def blackbox_ms(stacks: Stacks) -> Figure:
    """Time [ms] to write a black box: 60 s of an arm in motion, as it was recorded on the stack."""
    told = _told(_messages(_minute(stacks)))
    samples: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(3):
            began = time.monotonic()
            write_black_box(Path(folder) / str(len(samples)), "bench", {}, *told)
            samples.append(1e3 * (time.monotonic() - began))
    return of_samples(samples, note=f"{len(told[1])} messages, in a thread beside the logger's own work")


def blackbox_cpu_percent(stacks: Stacks) -> Figure:
    """CPU time [% of one core] of keeping the last minute in memory and looking at every message."""
    minute = _minute(stacks)
    samples = []
    for _ in range(3):
        began = time.process_time()
        _messages(minute)
        samples.append(100.0 * (time.process_time() - began) / 60.0)
    return of_samples(
        samples, BLACKBOX_GOAL, note=f"{len(minute)} messages of 60 s of streamed motion, decoded already"
    )


def _minute(stacks: Stacks) -> list[Entry]:
    """What the logger has heard while the arm moved for `HEARD` seconds, as often as a minute needs."""
    running = stacks.any_broker()
    swing(running, HEARD)
    time.sleep(1.0)  # two writes of the logger
    topics = {topic.key: topic for topic in recorded_topics()}
    rows = list(RecordingReader(_newest(running)).rows(topics.__contains__))
    end = rows[-1].message.log_time
    heard = [row for row in rows if end - row.message.log_time <= HEARD * 1e9]
    decoded = [
        Entry(topic, msgspec.json.decode(row.message.data, type=topic.message), row.message.log_time)
        for row in heard for topic in (topics[row.channel.topic],)
    ]  # fmt: skip
    return [
        Entry(each.topic, each.message, each.arrival + again * int(HEARD * 1e9))
        for again in range(round(60.0 / HEARD)) for each in decoded
    ]  # fmt: skip


def _messages(minute: list[Entry]) -> BlackBox:
    box = BlackBox()
    due = 0
    for each in minute:
        box.on_message(each.topic, each.message, each.arrival)
        if each.arrival > due:
            due = each.arrival + SECOND // 2
            box.step(each.arrival)
    return box


def _told(box: BlackBox) -> tuple[Incident, tuple[Entry, ...]]:
    now = time.time_ns() + 120 * SECOND
    box.seconds = 1e6  # nothing of the minute is too old for what is put behind it
    for mode in (DeviceMode.RUN, DeviceMode.FAULT):
        box.on_message(DEVICE_STATE, DeviceState(mode=mode, fault=DeviceFault.INTERNAL), now)
    told = box.finish(now)
    assert told is not None
    return told


def _newest(running: Running) -> Path:
    """The file that is being written."""
    files = sorted((Path(running.deployment.paths.out) / "recordings").glob("*.mcap"))
    if not files:
        raise NotMeasured("the logger has begun no file")
    return files[-1]


ROUNDS = 3
ROUNDED = 1e-9  # share by which floats may differ on another processor than the recordings'


def replay_speed() -> Figure:
    """Times real time at which the kept recordings are replayed, the slowest service for the median."""
    speeds: dict[str, list[float]] = {service: [] for service in SERVICES}
    for _ in range(ROUNDS):
        for service, samples in speeds.items():
            replayed = replay(project_root() / FOLDER / f"{service}.mcap", service, tolerance=ROUNDED)
            if replayed.difference is not None:
                raise NotMeasured(text_of(replayed))
            samples.append(replayed.speed)
    medians = {service: sorted(samples)[len(samples) // 2] for service, samples in speeds.items()}
    slowest = min(medians, key=lambda service: medians[service])
    note = f"of {slowest}, the slowest; {ROUNDS} rounds, reading the file not counted, every message compared"
    return of_samples(speeds[slowest], reference=medians, note=note)
