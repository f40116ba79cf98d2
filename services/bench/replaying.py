"""The figure of replays: how much faster than it was recorded a service goes through its recording again."""

from __future__ import annotations

from services.bench.figures import Figure, NotMeasured, of_samples
from services.replay.main import SERVICES, replay, text_of
from services.replay.make_recordings import FOLDER
from services.runtime.deployment import project_root

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
