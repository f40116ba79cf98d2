"""A LeRobotDataset, version 3.0, as files: frames and episodes in Parquet, images as recorded, statistics, card.

The layout is that which LeRobot 0.4.4 and 0.6.1 read (lerobot/datasets); neither is needed to write it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from gemelo.libraries.lerobot.episodes import Episode
from gemelo.libraries.lerobot.statistics import Statistics, image_statistics, statistics, statistics_together

VERSION = "v3.0"
FILES_IN_A_CHUNK = 1000
LARGEST_FILE = 100_000_000  # [B] of frames, after which the next episode begins a new file
PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA, EPISODES = f"data/{PLACE}.parquet", f"meta/episodes/{PLACE}.parquet"
STATE, ACTION, IMAGES = "observation.state", "action", "observation.images."
COUNTERS = {"frame_index": "int64", "episode_index": "int64", "index": "int64", "task_index": "int64"}
UNNAMED = "__index_level_0__"  # pandas' name of an index column


@dataclass(frozen=True)
class DatasetForm:
    """What every frame of a dataset has."""

    robot: str  # its robot_type
    fps: float  # [Hz]
    names: tuple[str, ...]  # of the values of state and action
    cameras: Mapping[str, tuple[int, int]]  # [px] width and height, by name
    task: str

    def features(self) -> dict[str, dict[str, Any]]:
        """As meta/info.json has them."""
        values = {"dtype": "float32", "shape": [len(self.names)], "names": list(self.names)}
        images = {
            f"{IMAGES}{name}": {"dtype": "image", "shape": [height, width, 3], "names": ["height", "width", "channels"]}
            for name, (width, height) in self.cameras.items()
        }
        counters = {"timestamp": "float32", **COUNTERS}
        return {
            ACTION: values,
            STATE: values,
            **images,
            **{name: {"dtype": kind, "shape": [1], "names": None} for name, kind in counters.items()},
        }


@dataclass
class DatasetWriter:
    """Writes one dataset into an empty folder, episode by episode; every method raises OSError."""

    folder: Path
    form: DatasetForm
    frames: int = 0
    _rows: list[dict[str, Any]] = field(default_factory=list)  # of the episodes
    _found: list[dict[str, Statistics]] = field(default_factory=list)
    _file: int = 0  # number of the file of frames
    _size: int = 0  # [B] of it
    _writer: pq.ParquetWriter | None = None

    def add(self, episode: Episode) -> None:
        """One episode, behind those before."""
        number, count = len(self._rows), len(episode.state)
        table = self._table(episode, number)
        if self._writer is not None and self._size + table.nbytes > LARGEST_FILE:
            self._writer.close()
            self._writer, self._file, self._size = None, self._file + 1, 0
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._new(DATA, self._file), table.schema)
        self._writer.write_table(table)
        self._size += table.nbytes
        found = self._statistics(episode, table)
        self._found.append(found)
        chunk, file = divmod(self._file, FILES_IN_A_CHUNK)
        self._rows.append(
            {
                "episode_index": number,
                "tasks": [self.form.task],
                "length": count,
                "data/chunk_index": chunk,
                "data/file_index": file,
                "dataset_from_index": self.frames,
                "dataset_to_index": self.frames + count,
                **{f"stats/{name}/{key}": value for name, each in found.items() for key, value in each.items()},
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
            }
        )
        self.frames += count

    def close(self) -> None:
        """Writes what is known at the end; without it the folder is no dataset."""
        if self._writer is not None:
            self._writer.close()
        pq.write_table(pa.Table.from_pylist(self._rows), self._new(EPISODES, 0))
        pq.write_table(_tasks([self.form.task]), self.folder / "meta/tasks.parquet")
        names = self._found[0] if self._found else ()
        together = {name: statistics_together([each[name] for each in self._found]) for name in names}
        self._write_json("meta/stats.json", together)
        self._write_json("meta/info.json", self._info())
        (self.folder / "README.md").write_text(_card(self.form), encoding="utf-8")

    def _table(self, episode: Episode, number: int) -> pa.Table:
        count = len(episode.state)
        columns = {ACTION: _values(episode.action), STATE: _values(episode.state)}
        for name, pictures in episode.images.items():
            kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
            columns[f"{IMAGES}{name}"] = pa.array([{"bytes": each, "path": None} for each in pictures], kind)
        frame = np.arange(count)
        columns["timestamp"] = pa.array((frame / self.form.fps).astype(np.float32))
        columns["frame_index"] = pa.array(frame)
        columns["episode_index"] = pa.array(np.full(count, number))
        columns["index"] = pa.array(self.frames + frame)
        columns["task_index"] = pa.array(np.zeros(count, np.int64))
        return pa.table(columns)

    def _statistics(self, episode: Episode, table: pa.Table) -> dict[str, Statistics]:
        found = {ACTION: statistics(episode.action), STATE: statistics(episode.state)}
        found |= {f"{IMAGES}{name}": image_statistics(each) for name, each in episode.images.items()}
        for name in ("timestamp", *COUNTERS):
            found[name] = statistics(table[name].to_numpy()[:, None])
        return found

    def _info(self) -> dict[str, Any]:
        form = self.form
        return {
            "codebase_version": VERSION,
            "robot_type": form.robot,
            "total_episodes": len(self._rows),
            "total_frames": self.frames,
            "total_tasks": 1,
            "chunks_size": FILES_IN_A_CHUNK,
            "data_files_size_in_mb": LARGEST_FILE // 1_000_000,
            "video_files_size_in_mb": 200,  # LeRobot's own: there are none
            "fps": int(form.fps) if float(form.fps).is_integer() else form.fps,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": DATA,
            "video_path": None,
            "features": form.features(),
        }

    def _new(self, place: str, number: int) -> Path:
        chunk, file = divmod(number, FILES_IN_A_CHUNK)
        path = self.folder / place.format(chunk_index=chunk, file_index=file)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def _write_json(self, place: str, value: object) -> None:
        (self.folder / place).write_text(json.dumps(value, indent=4), encoding="utf-8")


def _values(rows: np.ndarray[Any, np.dtype[np.float32]]) -> pa.Array:
    """Rows (n, features) as LeRobot keeps them: lists of a fixed size, a number where it is one."""
    flat = pa.array(rows.reshape(-1))
    return flat if rows.shape[1] == 1 else pa.FixedSizeListArray.from_arrays(flat, rows.shape[1])


def _tasks(tasks: Sequence[str]) -> pa.Table:
    """The numbers of the tasks, which pandas reads as indexed by their texts."""
    text = {"name": None, "field_name": UNNAMED, "pandas_type": "unicode", "numpy_type": "object", "metadata": None}
    number = {"name": "task_index", "field_name": "task_index", "pandas_type": "int64", "numpy_type": "int64",
              "metadata": None}  # fmt: skip
    about = {"index_columns": [UNNAMED], "column_indexes": [], "columns": [number, text], "pandas_version": "2.0.0"}
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), UNNAMED: pa.array(tasks)})
    return table.replace_schema_metadata({"pandas": json.dumps(about)})


def _card(form: DatasetForm) -> str:
    """The dataset's README: LeRobot keeps the names of values, and not their units."""
    cameras = "".join(f"- `{IMAGES}{name}`: {width} x {height} px\n" for name, (width, height) in form.cameras.items())
    names = ", ".join(f"`{name}`" for name in form.names)
    return f"""---
task_categories:
- robotics
tags:
- LeRobot
- gemelo
configs:
- config_name: default
  data_files: data/*/*.parquet
---

{form.task}

Recorded with gemelo on {form.robot}, {form.fps:g} frames a second by the stamps of the arm: `timestamp` is true time.

- `{STATE}` and `{ACTION}`: {names}
- joints in degrees, prismatic ones in millimetres; `gripper.pos` from 0 closed to 100 open
{cameras}"""
