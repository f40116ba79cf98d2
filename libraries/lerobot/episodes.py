"""Episodes of demonstrations as frames at a fixed rate: where each begins and ends, and what every frame holds."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.lerobot.demonstrations import SECOND, Array, Demonstrations
from gemelo.libraries.lerobot.values import ArmValues

LEAD = 0.04  # [s] by which the gateway plays a streamed target late (its `target_delay`): an action is so much earlier
NEW = 0.2  # [s] for which a streamed target is what is asked for; chosen: twice what ends a stream
TAIL = 0.3  # [s] chosen: after the last word of a motion the arm comes to rest, and stands for a few frames
SHORTEST = 2  # frames of an episode

Span = tuple[int, int]  # [ns] of its beginning and end
Floats = np.ndarray[Any, np.dtype[np.float32]]


@dataclass(frozen=True)
class Episode:
    """Frames at 1/fps one after the other, from time 0 on."""

    state: Floats  # (frames, features) in LeRobot's units
    action: Floats  # (frames, features)
    images: dict[str, tuple[bytes, ...]]  # (frames,) JPEGs, by camera


def spans(found: Demonstrations, gap: float, each_goal: bool) -> list[Span]:
    """Where something asked the arm to move, with pauses below `gap` [s]; or each goal of a trajectory by itself.

    Each goes on for `TAIL`, but not into the next one.
    """
    cut = sorted(found.goals.values()) if each_goal else _between_pauses(found, gap)
    following = [*(begin for begin, _ in cut[1:]), max((end for _, end in cut), default=0) + round(TAIL * SECOND)]
    return [
        (begin, max(end, min(end + round(TAIL * SECOND), other)))
        for (begin, end), other in zip(cut, following, strict=False)
    ]


def _between_pauses(found: Demonstrations, gap: float) -> list[Span]:
    moved = sorted(found.moved)
    cuts = [index for index in range(1, len(moved)) if moved[index] - moved[index - 1] > gap * SECOND]
    edges = [0, *cuts, len(moved)]
    return [(moved[begin], moved[end - 1]) for begin, end in itertools.pairwise(edges) if end > begin]


def episode(found: Demonstrations, arm: ArmDescription, span: Span, fps: float) -> Episode | None:
    """The frames of `span` at `fps` [Hz]; None where there are fewer than two, or no state was recorded then."""
    count = int((span[1] - span[0]) * fps / SECOND) + 1
    if count < SHORTEST or not found.states.times or not _overlap(found, span):
        return None
    times: Array = np.asarray(span[0] + np.arange(count) * (SECOND / fps), np.float64)
    state, action = found.states.between(times), asked(found, arm, times)
    values = ArmValues(arm, use_degrees=True, gripper=bool(found.gripper.times))
    if values.gripper is not None:
        gripper = found.gripper.held(times)
        state, action = np.column_stack([state, gripper[:, 0]]), np.column_stack([action, gripper[:, 1]])
    newest = {name: (track.newest(times), pictures) for name, (track, pictures) in found.images.items()}
    images = {name: tuple(pictures[index] for index in indices) for name, (indices, pictures) in newest.items()}
    return Episode(values.rows(state), values.rows(action), images)


def asked(found: Demonstrations, arm: ArmDescription, times: Array) -> Array:
    """What the joints were asked for [rad] or [m], (frames, joints), at `times` (frames,) [ns].

    The newest streamed target; where there is none, what the path asks for `LEAD` later: sent as targets, these rows
    make the arm do what was recorded, at the times at which it did.
    """
    path = found.commands if found.commands.times else found.states
    rows = path.between(times + LEAD * SECOND)
    for column, name in enumerate(arm.joint_names):
        if (track := found.targets.get(name)) is not None:
            newest = track.newest(times)
            age = times - np.asarray(track.times, float)[newest]
            rows[:, column] = np.where((age >= 0.0) & (age < NEW * SECOND), track.held(times)[:, 0], rows[:, column])
    return rows


def _overlap(found: Demonstrations, span: Span) -> bool:
    return found.states.times[0] <= span[1] and found.states.times[-1] >= span[0]
