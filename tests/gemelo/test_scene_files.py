"""A scene's file is written whole or stays as it was."""

import os
from pathlib import Path

import pytest

import gemelo
from gemelo.api.scene_files import read_scene, write_scene
from gemelo.schemas.scene import PlanningScene, SceneObject, SphereShape

ONE = PlanningScene(objects=(SceneObject(name="ball", shape=SphereShape(radius=0.02)),))


def test_a_scene_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cell.json"
    write_scene(ONE, path)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(gemelo.Error, match=r"cell\.json cannot be written: No space left on device"):
        write_scene(PlanningScene(), path)
    assert read_scene(path) == ONE
    assert list(tmp_path.iterdir()) == [path]


def test_no_device_and_no_folder_gives_its_place_to_a_scene(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path):
        with pytest.raises(gemelo.Error, match="cannot be written: it is there already, and is no file"):
            write_scene(ONE, path)
    assert (tmp_path / "pipe").is_fifo()
    assert list(tmp_path.iterdir()) == [tmp_path / "pipe"]


def test_a_link_keeps_pointing_to_the_scene(tmp_path: Path) -> None:
    real, link = tmp_path / "real.json", tmp_path / "cell.json"
    write_scene(PlanningScene(), real)
    link.symlink_to(real)
    write_scene(ONE, link)
    assert link.is_symlink()
    assert read_scene(real) == ONE
