"""Picks by a virtual camera on the whole stack: things go from place to place on a table with obstacles, by seed."""

from __future__ import annotations

import math
import os
import random
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import gemelo
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.cell import PosePlace
from gemelo.schemas.detections import Detections
from gemelo.schemas.topics import camera_truth
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples
from gemelo.tools.stack.stack import Stack

PROCESSES = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner", "camera", "detector")
CAMERA = "overhead"
PLACES, POSTS = 5, 1
APART = 0.06  # [m] between the middles of two places
LET_GO = 0.03  # [m] above the table
POST = (0.025, 0.025, 0.1)  # [m]
TO_TELL = 10.0  # [s] in which the camera tells where things are now, as it does every second
FLOOR = {"rm1": 1.65e-3, "parol6": 0.2e-3}  # [m] the nearest full step of the joints, at its worst place
MM = 1e3
GOAL = FigureGoal(p99=0.5)  # [mm] of what is beyond the floor


@dataclass(frozen=True)
class PickTable:
    """Where things may stand around an arm, and where it stands aside while the camera looks."""

    near: float  # [m] from the base's axis
    far: float  # [m]
    spread: float  # [rad] to either side of x
    aside: str  # a named state


TABLES = {"rm1": PickTable(0.22, 0.34, 1.0, "folded"), "parol6": PickTable(0.2, 0.3, 0.9, "ready")}


@dataclass(frozen=True)
class PickTrial:
    """One pick."""

    thing: str
    place: str
    off: float | None  # [m] on the table, from where it was to be; None where it was not picked
    reason: str  # why not


def draw_cell(robot: str, seed: int, folder: Path) -> tuple[Path, list[tuple[float, float, float]]]:
    """A cell.toml with the sample's camera, four things and `PLACES` places; and where [m] `POSTS` obstacles stand."""
    draw, table = random.Random(seed), TABLES[robot]
    spots: list[tuple[float, float]] = []
    while len(spots) < 4 + PLACES + POSTS:
        radius, angle = draw.uniform(table.near, table.far), draw.uniform(-table.spread, table.spread)
        spot = radius * math.cos(angle), radius * math.sin(angle)
        if all(math.dist(spot, other) > APART for other in spots):
            spots.append(spot)
        elif draw.random() < 0.02:
            spots.clear()  # no room is left: begin anew
    sample = (project_root() / "urdf" / robot / "cell.toml").read_text("utf-8")
    camera = sample[sample.index("[[camera]]") : sample.index("[[tag]]")]
    text = ["table = 0.0\n", camera]
    things = [
        ("cup", 'kind = "tag"\nid = 1\nsize = 0.025\nbox = [0.03, 0.03, 0.04]\ngrasp_offset = [0, 0, -0.012]', 0.04)
    ]
    block = 'kind = "colour"\ncolour = "{}"\nbox = [{}, 0.026, 0.03]'
    things += [(colour, block.format(colour, draw.choice((0.026, 0.03))), 0.015) for colour in ("red", "blue", "green")]
    for (name, kind, height), (x, y) in zip(things, spots, strict=False):
        where = f"position = [{x:.4f}, {y:.4f}, {height}]\nyaw = {draw.uniform(-1.5, 1.5):.3f}"
        text.append(f'[[thing]]\nname = "{name}"\n{kind}\n{where}\n')
    for number, (x, y) in enumerate(spots[4 : 4 + PLACES]):
        text.append(f'[[place]]\nname = "p{number}"\nkind = "pose"\nposition = [{x:.4f}, {y:.4f}, {LET_GO}]\n')
    path = folder / "cell.toml"
    path.write_text("\n".join(text), "utf-8")
    return path, [(x, y, POST[2] / 2.0) for x, y in spots[4 + PLACES :]]


@contextmanager
def arm_at_table(robot: str, seed: int) -> Iterator[gemelo.Arm]:
    """A stack of its own, ready to pick; this process's environment leads to it until the block ends."""
    before = dict(os.environ)
    with tempfile.TemporaryDirectory() as folder:
        cell, posts = draw_cell(robot, seed, Path(folder))
        environment = {"GEMELO_ROBOT": f"urdf/{robot}", "GEMELO_CELL": str(cell)}
        try:
            with Stack(processes=PROCESSES, environment=environment, broker="mosquitto") as stack:
                os.environ.update(stack.deployment)
                stack.wait_ready(30.0)
                with gemelo.connect(timeout=10.0) as arm:
                    if not arm.device.state.armed:
                        arm.device.arm()
                    arm.reference()
                    arm.scene.clear()
                    for number, at in enumerate(posts):
                        arm.scene.add_box(f"post{number}", POST, at=at)
                    yield arm
        finally:
            os.environ.clear()
            os.environ.update(before)


@cache
def picks(robot: str, count: int, seed: int) -> tuple[PickTrial, ...]:
    """So many things brought from where they are to a free place, each drawn by `seed`."""
    draw = random.Random(seed)
    taken: dict[str, str] = {}  # the place of each thing that was moved
    trials = []
    with arm_at_table(robot, seed) as arm:
        truth = arm.node.latest(camera_truth(CAMERA))
        cell = load_cell(Path(arm.deployment.cell), arm.description)
        for _ in range(count):
            thing = draw.choice(cell.things).name
            place = draw.choice([each for each in cell.places if each.name not in taken.values()])
            reason = _reason_of(arm, thing, place.name, TABLES[robot].aside)
            off = None
            if reason:
                print(f"bench: {robot}, seed {seed}, {thing} to {place.name}: {reason}", flush=True)
            else:
                taken[thing] = place.name
                ended = arm.node.now()
                arm.wait_for(partial(_is_since, truth, ended), TO_TELL)
                assert isinstance(place, PosePlace)
                off = math.dist(_where(truth.message, ended, thing), place.position[:2])
            trials.append(PickTrial(thing, place.name, off, reason))
    return tuple(trials)


def pick_mm(count: int, seed: int) -> Figure:
    """Distance [mm] on the table from where things are to where they were to be put, beyond the arm's step floor."""
    every = {robot: picks(robot, count, seed) for robot in TABLES}
    samples = [
        max(0.0, trial.off - FLOOR[robot]) * MM for robot, trials in every.items() for trial in trials
        if trial.off is not None
    ]  # fmt: skip
    reference = {
        f"with the floor, {robot}, worst": max((trial.off or 0.0) * MM for trial in trials)
        for robot, trials in every.items()
    }
    return of_samples(samples, GOAL, reference, "floor: 1.65 mm of rm1, 0.2 mm of parol6; virtual camera and arm")


def pick_success(count: int, seed: int) -> Figure:
    """Picks [%] that were carried out; all others were refused with a reason, which the note counts."""
    trials = [trial for robot in TABLES for trial in picks(robot, count, seed)]
    reasons = Counter(trial.reason.split(":")[0] for trial in trials if trial.off is None)
    done = 100.0 * sum(trial.off is not None for trial in trials) / len(trials)
    said = ", ".join(f"{number} {reason}" for reason, number in reasons.most_common()) or "none"
    return of_samples(
        [done], None, {}, f"{len(trials)} picks on both arms among obstacles, seed {seed}; not carried out: {said}"
    )


def _reason_of(arm: gemelo.Arm, thing: str, place: str, aside: str) -> str:
    """Picks it with the arm aside before; why it was not picked, or nothing."""
    try:
        arm.move(named=aside)
        arm.pick(thing, to=place)
    except (gemelo.Refused, gemelo.Aborted) as error:
        if any(item.attached for item in arm.scene.objects.values()):
            with suppress(gemelo.Refused, gemelo.Aborted):  # then the next pick says why
                arm.grip("open")
        return f"{error.check or 'refused' if isinstance(error, gemelo.Refused) else 'aborted'}: {error}"
    return ""


def _is_since(truth: Latest[Detections], moment: int) -> bool:
    return truth.message is not None and truth.message.stamp > moment


def _where(truth: Detections | None, since: int, thing: str) -> tuple[float, float]:
    """(x, y) [m] where the virtual camera has the thing in truth, told after `since` [ns] UNIX."""
    if truth is None or truth.stamp <= since:
        raise NotMeasured("the virtual camera does not tell where the things are")
    item = next(item for item in truth.items if item.name == thing)
    return item.base_from_thing.translation[0], item.base_from_thing.translation[1]
