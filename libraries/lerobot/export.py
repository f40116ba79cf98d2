"""A recording as a LeRobotDataset."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.lerobot.dataset import DatasetForm, DatasetWriter
from gemelo.libraries.lerobot.demonstrations import SECOND, Demonstrations, read_demonstrations
from gemelo.libraries.lerobot.episodes import episode, spans
from gemelo.libraries.lerobot.statistics import decoded
from gemelo.libraries.lerobot.values import ArmValues
from gemelo.libraries.recordings.reader import BadRecording, RecordingReader
from gemelo.libraries.recordings.shadow import recorded_robot, write_shadow
from gemelo.schemas.reasons import because


@dataclass(frozen=True)
class Exported:
    """What a dataset has."""

    episodes: int
    frames: int
    left_out: int  # spans too short for an episode
    cameras: dict[str, float]  # [Hz] at which images of each were recorded


def export_dataset(file: Path, folder: Path, task: str, fps: float, gap: float, each_goal: bool) -> Exported:
    """Writes the dataset at `fps` [Hz]; episodes end at pauses of `gap` [s], or with each goal.

    Raises `BadRecording`, FileExistsError where `folder` is there, OSError.
    """
    reader = RecordingReader(file)
    reader.require_own()
    reader.read_metadata()
    arm = recorded_arm(reader)
    found = read_demonstrations(reader, arm.joint_names)
    cut = spans(found, gap, each_goal)
    episodes = [each for span in cut if (each := episode(found, arm, span, fps)) is not None]
    if not episodes:
        raise BadRecording(because("recording.lerobot.none", file=str(file)))
    values = ArmValues(arm, use_degrees=True, gripper=bool(found.gripper.times))
    sizes = {name: decoded(pictures[0]).size for name, (_, pictures) in found.images.items()}
    folder.mkdir(parents=True)
    writer = DatasetWriter(folder, DatasetForm(arm.name, fps, tuple(values.features), sizes, task))
    for each in episodes:
        writer.add(each)
    writer.close()
    return Exported(len(episodes), writer.frames, len(cut) - len(episodes), _rates(found))


def recorded_arm(reader: RecordingReader) -> ArmDescription:
    """The arm by the files that were recorded; raises `BadRecording` where there are none, or they are wrong."""
    with tempfile.TemporaryDirectory(prefix="gemelo-") as place:
        folder = Path(place) / "arm"
        write_shadow(reader, folder, recorded_robot(reader), Path(place) / "no meshes")
        try:
            return load_arm(folder)
        except ValueError as error:
            what = because("recording.robot.unreadable", file=str(reader.path), error=str(error))
            raise BadRecording(what) from error


def _rates(found: Demonstrations) -> dict[str, float]:
    rates = {}
    for name, (track, _) in found.images.items():
        span = (track.times[-1] - track.times[0]) / SECOND
        rates[name] = (len(track.times) - 1) / span if span > 0.0 else 0.0
    return rates
