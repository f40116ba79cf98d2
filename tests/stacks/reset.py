"""Leads a shared stack back to how it was before a test, and says what the test has left behind."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import psutil
import pytest

import gemelo
from gemelo.libraries.runtime.endpoints import parameter_request, parameters_request
from gemelo.schemas import system
from gemelo.schemas.topics import DEVICE_SHAFT, camera_truth
from gemelo.tools.stack.stack import Stack
from tests.simulated import put_right, where_it_stands

READY = 60.0  # [s] in which a process that a test has killed is there again
CAMERA = "overhead"  # of the sample cell
LAID_BACK = 1e-3  # [m] by which a thing that nobody has carried may differ from where it lay
SETTLED = 2.0  # [s] after rest in which what is said of the shafts is of where they rest
LETS_GO = 6.0  # [s] in which control, motions and processes of a client that has just ended are over

Values = dict[tuple[str, str], system.ParameterValue]
Places = dict[str, tuple[float, ...]]  # [m] of things in the base frame


class Before(NamedTuple):
    """What stands when a test begins, and is to stand when it has ended."""

    children: frozenset[int]  # process ids of the tests' own
    logs: dict[str, int]  # characters that each process had printed
    files: frozenset[Path]  # of points, programs and scenes


class Reset:
    """Of one shared stack, on a connection of its own that stays open."""

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._arm = self._connected()
        self._parameters: Values = {}
        self._shaft = self._arm.node.latest(DEVICE_SHAFT)
        self._truth = self._arm.node.latest(camera_truth(CAMERA)) if "camera" in stack.processes else None
        self._laid: Places = {}
        try:
            self._put_right()
            if self._truth is not None:
                assert self._becomes(lambda: bool(self._places()), READY), f"nothing on {camera_truth(CAMERA).key}"
                self._laid = self._places()
            self._parameters = self._read_parameters()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Leaves the bus."""
        self._arm.close()

    def before(self) -> Before:
        """Leads the arm home, with the cell's things where they lay; to be given to `after`."""
        if not self._lie_there():
            self._stack.kill("camera")  # a virtual one that starts anew has them where the cell file says
            assert self._becomes(self._lie_there, READY), f"things are not back: {self._places()}, not {self._laid}"
            self._stack.wait_ready(READY)
        self._stand(self._arm.states["home"])
        return Before(
            frozenset(each.pid for each in psutil.Process().children()),
            {name: len(self._stack.logs(name)) for name in self._stack.processes},
            frozenset(self._files()),
        )

    def after(self, before: Before) -> list[str]:
        """What the test should have ended or put back itself, a sentence for each; all of it is put right."""
        left = [*self._processes(), *self._children(before), *self._complaints(before)]
        left += [*self._motion(), *self._control(), *self._device(), *self._changed_parameters()]
        self._put_right()
        self._forget(self._files() - before.files)
        return left

    def _forget(self, files: set[Path]) -> None:
        """What was taught; a page that has it open, and says that it is unsaved then, starts anew."""
        for path in files:
            path.unlink()
        if files and "panel" in self._stack.processes:
            self._stack.kill("panel")
            self._stack.wait_ready(READY)

    def _processes(self) -> Iterator[str]:
        """Frozen ones; those that were killed have time to come back."""
        for name, pid in self._stack.pids().items():
            if psutil.Process(pid).status() == psutil.STATUS_STOPPED:
                os.kill(pid, signal.SIGCONT)
                yield f"{name} is frozen"
        self._stack.wait_ready(READY)

    def _children(self, before: Before) -> Iterator[str]:
        """Programs that the test has started."""
        mine = [each for each in psutil.Process().children() if each.pid not in before.children]
        for each in psutil.wait_procs(mine, timeout=LETS_GO if mine else 0.0)[1]:
            yield f"the process {each.pid} still runs: {' '.join(each.cmdline()[:6])}"
            each.kill()

    def _complaints(self, before: Before) -> Iterator[str]:
        for name, size in before.logs.items():
            said = self._stack.logs(name)[size:]
            if "Traceback" in said:
                yield f"{name} has raised: {said[said.index('Traceback') :][:2000]}"

    def _control(self) -> Iterator[str]:
        control = self._arm.control
        if not self._becomes(lambda: not control.held, LETS_GO):
            yield f"{control.holder} holds control"
            self._arm.take_control("reset", force=True).give()

    def _motion(self) -> Iterator[str]:
        arm = self._arm
        if not self._becomes(lambda: _rests(arm), LETS_GO):
            yield f"the arm still moves, device mode {arm.device.mode.name}"
            arm.stop()
            assert self._becomes(lambda: _rests(arm), LETS_GO), "the arm does not come to rest"

    def _device(self) -> Iterator[str]:
        """What is pressed, switched on, slowed down or in a fault."""
        arm = self._arm
        if arm.inputs.get("estop"):
            yield "the emergency stop is pressed"
        if on := [name for name, is_on in arm.outputs.items() if is_on]:
            yield f"outputs are on: {', '.join(on)}"
            for name in on:
                arm.output(name, False)
        for kind, targets, value in (
            ("estop", ("",), 0.0),
            ("switch", [each.name for each in arm.description.inputs], -1.0),
            ("block", arm.joint_names, 0.0),
        ):
            for target in targets:
                arm.device.inject(kind, target, value)
        if arm.device.fault:
            yield f"the device has a fault: {arm.device.fault}"
            arm.device.reset()

    def _changed_parameters(self) -> Iterator[str]:
        for (node, name), value in self._read_parameters().items():
            usual = self._parameters.get((node, name), value)
            if value != usual:
                yield f"{node}'s parameter {name} is {value}, it was {usual}"
                setting = parameter_request(node)
                self._arm.node.call(setting, system.SetParameter(name=name, value=usual), READY)

    def _read_parameters(self) -> Values:
        found: Values = {}
        for node in self._stack.processes:
            if node in self._arm.node.alive():
                asked = parameters_request(node)  # which a node that has just come serves a moment after it is seen
                assert self._becomes(lambda asked=asked: self._arm.node.is_served(asked), READY), f"{asked.key}: nobody"
                answer = self._arm.node.call(asked, system.Empty(), READY)
                found |= {(node, each.name): each.value for each in answer.parameters}
        return found

    def _put_right(self) -> None:
        """Without a word: armed, referenced where it really stands, at full speed, with an empty scene."""
        self._stack.wait_ready(READY)
        put_right(self._arm)
        if not self._becomes(
            self._is_where_it_says, SETTLED
        ):  # a person has declared otherwise, or a shaft has slipped
            self._arm.reference(where_it_stands(self._arm))

    def _is_where_it_says(self) -> bool:
        shaft, joint = self._shaft.message, self._arm.description.joint
        return shaft is not None and all(
            abs(at - self._arm.joints[name]) * joint(name).steps.per_unit <= 3.0
            for name, at in zip(shaft.name, shaft.position, strict=True)
        )

    def _places(self) -> Places:
        newest = self._truth.message if self._truth is not None else None
        return {each.name: tuple(each.base_from_thing.translation) for each in newest.items} if newest else {}

    def _lie_there(self) -> bool:
        there = self._places()
        return all(math.dist(there.get(name, (math.inf,) * 3), at) < LAID_BACK for name, at in self._laid.items())

    def _stand(self, where: dict[str, float]) -> None:
        arm = self._arm
        steps = {name: arm.description.joint(name).steps.per_unit for name in where}
        if any(abs(arm.joints[name] - at) * steps[name] > 1.0 for name, at in where.items()):
            arm.move(joints=where)

    def _files(self) -> set[Path]:
        return {path for path in Path(self._stack.deployment["GEMELO_PATHS_PROGRAMS"]).rglob("*") if path.is_file()}

    def _becomes(self, is_so: Callable[[], bool], timeout: float) -> bool:
        return self._arm.wait_for(is_so, timeout)

    def _connected(self) -> gemelo.Arm:
        self._stack.wait_ready(READY)
        with pytest.MonkeyPatch.context() as patch:
            patch.delenv("GEMELO_CONFIG", raising=False)
            for name, value in self._stack.deployment.items():
                patch.setenv(name, value)
            arm = gemelo.connect(name="reset", timeout=60.0)
        arm.control.shares = False
        return arm


def _rests(arm: gemelo.Arm) -> bool:
    still = all(abs(speed) < 1e-3 for speed in arm.velocities.values())
    return still and arm.device.mode is not gemelo.DeviceMode.RUN
