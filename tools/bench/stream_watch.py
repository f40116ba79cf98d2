"""Cost of looking at the way of streamed targets, at 50 targets a second."""

from __future__ import annotations

import numpy as np

from gemelo.tools.bench.figures import Figure, FigureGoal, rounded
from gemelo.tools.bench.leaders import Sender, lead, person
from gemelo.tools.bench.scenes import parol6, rm1
from gemelo.tools.bench.watched_arm import WatchedArm, world_with

CPU_GOAL = FigureGoal(median=10.0)  # [%] of a core
RATE, SECONDS, SEED = 50.0, 10.0, 3  # [Hz], [s], of the persons
SHARE = 0.5  # of the limits, at which the persons lead all joints together
BOXES = (
    ((0.04, 0.04, 0.6), (0.25, 0.2, 0.3)),
    ((0.6, 0.6, 0.02), (0.3, 0.0, -0.05)),
    ((0.1, 0.3, 0.1), (0.3, -0.3, 0.1)),
)


def stream_watch_cpu() -> Figure:
    """CPU time of the looks as a share [%] of a core, of persons who lead all joints of parol6 among three boxes."""
    shares: dict[str, float] = {}
    looks = np.empty(0)
    for arm in (rm1(), parol6()):
        rig = WatchedArm(arm=arm, start=arm.named_states["ready"], world=world_with(arm, *BOXES))
        rig.ready().run(0.5)
        rig.looks.clear()
        signals = {column: person(joint, SEED + column, SECONDS, SHARE) for column, joint in enumerate(arm.joints)}
        lead(rig, signals, SECONDS, Sender(RATE))
        looks = 1e3 * np.array(rig.looks)
        shares[arm.name] = 0.1 * float(looks.sum()) / SECONDS
    median, p99 = (rounded(float(np.quantile(looks, q))) for q in (0.5, 0.99))
    return Figure(
        median=rounded(shares["parol6"]), p99=rounded(shares["parol6"]), goal=str(CPU_GOAL),
        met=CPU_GOAL.is_met(shares["parol6"], shares["parol6"]),
        reference={"rm1": rounded(shares["rm1"]), "one look [ms], median": median, "one look [ms], p99": p99},
        note=f"parol6, {len(looks)} looks in {SECONDS:g} s; virtual time, the looks in CPU time",
    )  # fmt: skip
