"""The scenes that were saved are offered by their names, and one that is chosen is the one that is loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.panel.view.tabs import scene as scene_tab
from tests.panel.memory_page import memory_page
from tests.runtime.support import until

POST = SceneObject(
    name='a "post"',
    shape=BoxShape(size=(0.04, 0.04, 0.16)),
    pose=Transform(translation=(0.29, 0.27, 0.08), rotation=(0.0, 0.0, 0.0, 1.0)),
)


def test_a_scene_that_is_saved_is_offered_at_once_and_chosen_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(scene_tab, "FOLDER", tmp_path / "scenes")
    assert scene_tab.saved_scenes() == ()
    with memory_page("rm1", tmp_path) as page:
        page.gateway.show_scene(PlanningScene(objects=(POST,)))
        assert until(lambda: len(page.panel.operator.bus.scene.objects) == 1)
        page.draw(5)
        [shown] = page.panel.pages()
        tab = shown.scene
        for name in ("table", "post"):
            tab.file.value = name
            tab.save()
        assert tab.saved.options == ("choose ...", "post.json", "table.json")
        tab.saved.value = "table.json"
        tab.take_name()
        assert tab.path() == tmp_path / "scenes/table.json"
    assert POST.name in (tmp_path / "scenes/table.json").read_text().replace("\\", "")
    assert scene_tab.saved_scenes() == ("post.json", "table.json")
