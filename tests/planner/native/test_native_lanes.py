"""Sphere centres of eight configurations at once: against pinocchio, and every build against every other."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision_geometry.shapes import ShapeKind
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.native_planner import NativePlanner
from tests.planner.native.conftest import load
from tests.planner.native.scenes import random_shape
from tests.profiles import count

SLACK = 1e-5  # [m]: half of what the radii have in excess for the floats


@pytest.mark.scaled
def test_the_spheres_are_where_pinocchio_puts_them(arm, core, configurations):
    kinematics = Kinematics(arm)
    for row in configurations(count(quick=2, full=8), 1):
        poses = kinematics.link_poses(row)
        expected = []
        for link, cover in core.covers.items():
            x, y, z, w = poses[link].rotation
            turn = pin.Quaternion(w, x, y, z).matrix()
            expected.append(cover.spheres[:, :3] @ turn.T + poses[link].translation)
        centres = core.sphere_centres(row[None, :])[0].astype(float)
        for some in np.array_split(np.vstack(expected), 8):
            away = np.linalg.norm(some[:, None, :] - centres[None, :, :], axis=2)
            assert away.min(axis=1).max() < SLACK
        assert len(centres) == core.sphere_count


def test_angles_of_many_turns_lose_little(arm, core):
    turning = np.array([joint.unit == "rad" for joint in arm.joints])
    row = np.full(len(arm.joints), 0.1)
    near, far = core.sphere_centres(row[None, :]), core.sphere_centres((row + 2.0 * np.pi * 15 * turning)[None, :])
    assert np.abs(near - far).max() < 2.0 * SLACK


@pytest.mark.parametrize("name", [name for name in motion.kernel_names() if name != "plain"])
def test_every_build_gives_the_same_bits_as_the_plain_one(name, arm, configurations):
    fast, plain = NativePlanner(arm, kernel=name), NativePlanner(arm, kernel="plain")
    rows = configurations(4003, 2)  # the last lanes are not all used
    assert np.array_equal(fast.sphere_centres(rows[:200]), plain.sphere_centres(rows[:200]))
    rng = np.random.default_rng(3)
    scene = [random_shape(rng, kind, f"{kind} {i}") for i in range(2) for kind in ShapeKind]
    for core in (fast, plain):
        core.set_scene(scene)
    verdicts = fast.free(rows)
    assert np.array_equal(verdicts, plain.free(rows))
    assert verdicts.any()
    assert not verdicts.all()
    assert [fast.distance(row) for row in rows[:100]] == [plain.distance(row) for row in rows[:100]]


def test_the_order_of_the_rows_changes_no_verdict(core, configurations):
    rows = configurations(1000, 4)
    order = np.random.default_rng(5).permutation(len(rows))
    assert np.array_equal(core.free(rows)[order], core.free(rows[order]))


def test_no_function_built_for_one_processor_can_be_linked_into_the_others():
    build = Path(motion.__file__).parent / "build"
    for name in ("avx2.o", "vector.o", "plain.o"):
        if not (build / name).exists():
            continue
        listed = subprocess.run(["nm", build / name], capture_output=True, text=True, check=True, timeout=30).stdout
        kinds = {line.split()[-2] for line in listed.splitlines()}
        assert kinds <= set("DdRrTtBbU"), f"{name}: {kinds}"
        assert sum(" T " in line or " D " in line for line in listed.splitlines()) == 1


def test_a_kernel_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(ValueError, match=r'no kernel "avx9" on this processor, only .*plain'):
        NativePlanner(load("rm1"), kernel="avx9")
