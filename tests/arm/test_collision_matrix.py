"""Pairs of links that need no check, and the update of the SRDF's text with them."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.collision_matrix import DisabledReason, are_adjacent, collision_matrix
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.kinematics.link_distances import LinkDistances
from gemelo.libraries.arm.kinematics.self_collisions import SelfCollisionChecker
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.srdf_edit import entries, with_pairs
from gemelo.schemas.reasons import Reason
from tests.arm.editing import edit
from tests.arm.plates import add_rigid_plates, add_turning_disc

TEXT = """<robot name="r">
  <!-- <disable_collisions link1="a" link2="z" reason="Never"/> is what a person thought once -->
  <group name="arm"/>
  <!-- neighbours -->
  <disable_collisions link1="a" link2="b" reason="Adjacent"/>
  <disable_collisions link2='c' link1='b' reason='Never'></disable_collisions>

  <!-- the end -->
</robot>
"""


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_the_shipped_matrix_is_what_sampling_finds(rm1_folder: Path, robot: str) -> None:
    arm = load_arm(rm1_folder.parent / robot)
    found = {frozenset(verdict.pair): verdict.reason for verdict in collision_matrix(arm, samples=1500)}
    shipped = {entry.pair: entry.reason for entry in entries(arm.srdf_path.read_text())}
    assert {pair: str(reason) for pair, reason in found.items() if reason is not None} == shipped


def test_the_matrix_is_the_same_every_time(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder)
    assert collision_matrix(arm, samples=50) == collision_matrix(arm, samples=50)


def test_distances_name_every_pair_with_its_nearest_shapes(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder.parent / "parol6")
    kinematics = Kinematics(arm)
    checker = SelfCollisionChecker(arm, kinematics.model, kinematics.configuration)
    for configuration in arm.named_states.values():
        distances = checker.distances(configuration)
        assert tuple(distances) == checker.pairs
        assert min(distances.values()) == pytest.approx(checker.distance(configuration), abs=2e-6)


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_the_bounds_of_the_matrix_hold_and_its_distances_are_the_checkers(rm1_folder: Path, robot: str) -> None:
    arm = load_arm(rm1_folder.parent / robot)
    kinematics = Kinematics(arm)
    bare = replace(arm, disabled_collisions=frozenset())
    checker = SelfCollisionChecker(bare, kinematics.model, kinematics.configuration, with_rigid=True)
    random = np.random.default_rng(5)
    lower, upper = (np.array([getattr(joint, side) for joint in arm.joints]) for side in ("lower", "upper"))
    configurations = random.uniform(lower, upper, (25, len(lower)))
    links = LinkDistances(arm, kinematics.model, kinematics.configuration, configurations)
    assert set(links.pairs) == set(checker.pairs)
    for row, configuration in enumerate(configurations):
        exact = checker.distances(configuration)
        for number, pair in enumerate(links.pairs):
            least, most = links.bounds[row, number]
            assert least <= exact[pair] + 2e-6
            assert exact[pair] <= most + 2e-6
            assert links.distance(pair, configuration) == pytest.approx(exact[pair], abs=2e-6)
            assert links.distance(pair, configuration, -1.0) == -1.0


def test_progress_of_the_matrix_is_told(rm1_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.libraries.arm.kinematics.collision_matrix.SAYING", 0.0)
    progress: list[Reason] = []
    collision_matrix(load_arm(rm1_folder), samples=20, tell=progress.append)
    assert progress[0].code == "fit.pairs.sampled"
    assert re.fullmatch(r"\d+ configurations sampled after \d+\.\d s", str(progress[0]))
    assert re.fullmatch(r"6 of 6 pairs of links after \d+\.\d s", str(progress[-1]))


def test_links_without_a_shape_do_not_keep_neighbours_apart(tmp_path: Path, rm1_folder: Path) -> None:
    shutil.copytree(rm1_folder, tmp_path / "rm1")
    urdf = tmp_path / "rm1" / "robot.urdf"
    text = urdf.read_text()
    start = text.index('<link name="antebrazo_link"')
    first, last = text.index("<collision>", start), text.index("</link>", start)
    end = text.rindex("</collision>", first, last) + len("</collision>")
    urdf.write_text(text[:first] + text[end:])
    arm = load_arm(tmp_path / "rm1")
    assert are_adjacent(arm, "efector_link", "brazo_link")
    assert not are_adjacent(arm, "efector_link", "base_link")


def test_only_elements_that_count_are_read() -> None:
    assert [(set(entry.pair), entry.reason) for entry in entries(TEXT)] == [
        ({"a", "b"}, "Adjacent"),
        ({"b", "c"}, "Never"),
    ]


def test_nothing_to_change_changes_no_byte() -> None:
    assert with_pairs(TEXT, {("b", "a"): "Adjacent", ("b", "c"): "Never"}) == TEXT


def test_changes_leave_everything_else_as_it_was() -> None:
    changed = with_pairs(TEXT, {("a", "b"): "Adjacent", ("a", "c"): "Always"})
    assert changed == TEXT.replace(
        "  <disable_collisions link2='c' link1='b' reason='Never'></disable_collisions>\n",
        '  <disable_collisions link1="a" link2="c" reason="Always"/>\n',
    )
    empty = with_pairs(TEXT, {})
    assert entries(empty) == []
    assert "<!-- neighbours -->" in empty
    again = with_pairs(empty, {("a", "b"): str(DisabledReason.ADJACENT)})
    assert again.endswith('  <disable_collisions link1="a" link2="b" reason="Adjacent"/>\n</robot>\n')


def test_a_text_without_an_end_is_refused() -> None:
    with pytest.raises(ValueError, match="no </robot>"):
        with_pairs("<robot>", {("a", "b"): "Never"})


def test_links_rigid_to_one_another_are_excused_however_near_they_stand(copy: Path) -> None:
    add_rigid_plates(copy, gap=0.002)
    found = {frozenset(each.pair): each for each in collision_matrix(load_arm(copy), samples=30)}
    plates = found[frozenset(("left_plate", "right_plate"))]
    assert plates.reason is DisabledReason.RIGID
    assert plates.nearest == pytest.approx(0.002, abs=1e-6)
    assert all(each.reason is not None for pair, each in found.items() if pair <= {"base_link", "left_plate"})


@pytest.mark.parametrize(("gap", "reason"), [(0.0016, DisabledReason.ALWAYS), (0.0045, None), (0.008, "Never")])
def test_links_never_farther_apart_than_the_clearance_are_excused(copy: Path, gap: float, reason: str | None) -> None:
    add_turning_disc(copy, gap)
    found = {frozenset(each.pair): each.reason for each in collision_matrix(load_arm(copy), samples=30)}
    assert found[frozenset(("rest_plate", "disc"))] == reason


def test_the_robots_own_clearance_says_which_links_are_always_near(copy: Path) -> None:
    add_turning_disc(copy, gap=0.0016)
    edit(copy / "robot.toml", 'tool_frame = "efector_link"', 'tool_frame = "efector_link"\nclearance = 0.001')
    found = {frozenset(each.pair): each.reason for each in collision_matrix(load_arm(copy), samples=30)}
    assert found[frozenset(("rest_plate", "disc"))] is None
