"""A scene's file is written whole or stays as it was."""

from pathlib import Path

import pytest

import gemelo
from gemelo.scene_files import read_scene, write_scene
from schemas.scene import PlanningScene, SceneObject, SphereShape

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
