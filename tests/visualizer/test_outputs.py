"""A viewer that goes and comes back is told everything again; the service never waits for it."""

import os
import resource
import subprocess
import time
from contextlib import contextmanager

import pytest
from rerun.experimental import ViewerClient

from gemelo.libraries.runtime.process.unwritten import RETRY
from gemelo.schemas.deployment import ViewerMode, ViewerSection
from gemelo.schemas.joints import JointState
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.program.rerun_program import environment, free_port, rerun_binary
from gemelo.services.visualizer.render.arms_layout import SharedView
from gemelo.services.visualizer.render.layout import ArmLayout
from gemelo.services.visualizer.render.outputs import Outputs, VisualizerParameters
from gemelo.services.visualizer.render.recording_file import FLUSHED
from tests.optional import need

START = 1_795_000_000_000_000_000
NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")


@contextmanager
def headless_viewer(port):
    need("vulkan")  # it draws, though nobody sees it
    command = [rerun_binary(), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--memory-limit", "200MB"]
    process = subprocess.Popen(
        command, env=environment(os.environ), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield f"rerun+http://127.0.0.1:{port}/proxy"
    finally:
        process.kill()
        process.wait()


@contextmanager
def files_no_larger_than(size):
    """No file of this process grows beyond `size` [bytes], as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def printed(path):
    """What Rerun's own program reads in a recording."""
    return subprocess.run(
        [rerun_binary(), "rrd", "print", str(path)], env=environment(os.environ), capture_output=True, text=True,
        check=False,
    ).stdout  # fmt: skip


class Rig:
    def __init__(self, core, folder, viewer, shared=None, **parameters):
        self.core = core
        self.outputs = Outputs(viewer, folder, folder, VisualizerParameters(**parameters), shared=shared)
        self.batch = 0
        self.slowest = 0.0

    def step(self):
        self.batch += 1
        now = START + self.batch * 100_000_000
        self.core.on_joint_state(JointState(stamp=now, name=NAMES, position=(0.01 * self.batch, 0.0, 0.0)))
        began = time.monotonic()
        trouble = self.outputs.step(self.core, now, began)
        self.slowest = max(self.slowest, time.monotonic() - began)
        return trouble

    def step_until(self, is_done, timeout=60.0):
        deadline = time.monotonic() + timeout
        while not is_done():
            assert time.monotonic() < deadline, self.step()
            self.step()
            time.sleep(0.1)


def shows_the_arm(url, root=""):
    """Whether the viewer there has a recording with the static and the moving parts of the arm, under `root`."""
    try:
        schema = ViewerClient.connect(url).get_recording_schema(paths_only=True)
    except (RuntimeError, ValueError, ConnectionError):
        return False
    text = str(schema)
    visual = f"{root}/{entities.MEASURED}/base_link/brazo_link/visual_0"
    return visual in text and f"{root}/{entities.executed('brazo_joint')}" in text


@pytest.mark.full
def test_a_viewer_that_comes_back_is_told_everything_again(core, tmp_path):
    viewer = ViewerSection(mode=ViewerMode.WEB, port=free_port())
    rig = Rig(core, tmp_path, viewer)
    assert rig.step() == f"no viewer at 127.0.0.1:{viewer.port}"
    for _ in range(2):
        with headless_viewer(viewer.port) as url:
            rig.step_until(lambda: not rig.step())
            rig.step_until(lambda url=url: shows_the_arm(url))
        rig.step_until(lambda: bool(rig.step()))
    began = time.monotonic()
    rig.outputs.close()
    assert time.monotonic() - began < 5.0
    assert rig.slowest < 1.0


@pytest.mark.full
def test_several_arms_meet_in_one_recording_of_one_viewer_and_one_that_comes_back_is_in_it_again(model, tmp_path):
    viewer = ViewerSection(mode=ViewerMode.WEB, port=free_port())
    arms = tuple(ArmLayout(model, 20.0, 20.0, robot=name) for name in ("left", "right"))

    def arm(name):
        return Rig(Visualizer(model, name, "efector_link"), tmp_path, viewer, shared=SharedView(name, arms))

    rigs = [arm("left"), arm("right")]
    with headless_viewer(viewer.port) as url:
        for rig in rigs:
            rig.step_until(lambda rig=rig: not rig.step())
        for rig, root in zip(rigs, ("left", "right"), strict=True):
            rig.step_until(lambda root=root: shows_the_arm(url, f"/{root}"))
        rigs[0].outputs.close()
        again = arm("left")
        again.step_until(lambda: not again.step())
        again.step_until(lambda: shows_the_arm(url, "/left"))
        state = ViewerClient.connect(url).get_state()
        assert len(state.recordings) == 1, state
        rigs[1].outputs.close()
        again.outputs.close()


def test_without_a_viewer_only_the_recording_is_written(core, tmp_path):
    rig = Rig(core, tmp_path, ViewerSection(mode=ViewerMode.NONE), recording_path="deep/view.rrd")
    assert rig.step() == ""
    rig.outputs.close()
    printed = subprocess.run(
        [rerun_binary(), "rrd", "print", tmp_path / "deep" / "view.rrd"], capture_output=True, text=True, check=True
    )
    assert f"/{entities.executed('brazo_joint')}" in printed.stdout


def test_a_recording_begins_as_soon_as_its_disk_takes_it_and_goes_on_beside_it_after_a_full_one(core, tmp_path):
    (tmp_path / "file").write_text("in the way")
    rig = Rig(core, tmp_path, ViewerSection(mode=ViewerMode.NONE), recording_path="file/view.rrd")
    assert "cannot write the recording" in rig.step()
    (tmp_path / "file").unlink()
    rig.step_until(lambda: not rig.step(), 3.0 * RETRY)
    first, second = tmp_path / "file/view.rrd", tmp_path / "file/view-2.rrd"
    small = 8192
    assert first.stat().st_size > small
    with files_no_larger_than(small):
        rig.step_until(lambda: "goes on in a file beside it" in rig.step(), 3.0 * FLUSHED)
        rig.step_until(lambda: "cannot write the recording" in rig.step(), 3.0 * RETRY)
    rig.step_until(lambda: not rig.step(), 3.0 * RETRY)
    rig.outputs.close()
    for path in (first, second):
        assert "brazo_link" in printed(path)
    assert sorted((tmp_path / "file").iterdir()) == [second, first]


def test_a_recording_that_cannot_be_written_is_said_and_nothing_dies(core, tmp_path):
    (tmp_path / "file").touch()
    rig = Rig(core, tmp_path, ViewerSection(mode=ViewerMode.NONE), recording_path="file/view.rrd")
    assert "cannot write the recording" in rig.step()
    assert "cannot write the recording" in rig.step()
    rig.outputs.close()


@pytest.mark.parametrize("mode", [ViewerMode.NONE, ViewerMode.WEB])
def test_closing_at_once_does_not_wait(core, tmp_path, mode):
    rig = Rig(core, tmp_path, ViewerSection(mode=mode, port=free_port()))
    began = time.monotonic()
    rig.outputs.close()
    assert time.monotonic() - began < 3.0
