"""The API in programs of their own on the whole stack: line by line, forked, beside an event loop, and what is lost."""

from __future__ import annotations

import asyncio
import doctest
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import gemelo
from gemelo.tools.stack.stack import Stack
from tests.gemelo.own_names import run_among_own_names
from tests.gemelo.test_docstrings import ON_THE_STACK, OPTIONS, PUBLIC
from tests.stack.scripts import ended, said, script


def test_it_works_where_an_event_loop_runs_as_in_a_notebook(arm: gemelo.Arm) -> None:
    async def cell() -> dict[str, float]:
        motion = arm.move(joints={"brazo_joint": 0.1})
        await asyncio.sleep(0)
        return motion.stopped_at

    with ThreadPoolExecutor(1) as pool:  # in this one a browser's library may have a loop of its own
        stopped_at = pool.submit(asyncio.run, cell()).result(60.0)
    assert stopped_at == pytest.approx(arm.joints, abs=1e-9)


def test_it_works_beside_modules_of_a_users_own_with_the_names_of_our_rooms(twin: Stack, tmp_path: Path) -> None:
    text = """
import gemelo
with gemelo.connect() as arm:
    print(arm.move(joints={"brazo_joint": 0.2}).result.executed_steps is not None, round(arm.joints["brazo_joint"], 2))
"""
    done = run_among_own_names(tmp_path, text, **twin.deployment)
    assert (done.stdout, done.stderr, done.returncode) == ("True 0.2\n", "", 0)


def test_it_works_line_by_line_and_ends_with_the_prompt(twin: Stack) -> None:
    lines = "import gemelo\narm = gemelo.connect()\narm.name\narm.move(named='home')\nsorted(arm.joints)[0]\n"
    with script(twin, "", "-i", "-q") as process:
        code, output, _ = ended(process, lines)
    assert code == 0
    first, moved, joint = output.splitlines()
    assert (first, joint) == ("'rm1'", "'antebrazo_joint'")
    assert moved.startswith("<Motion rm1: named='home', succeeded in")


def test_a_forked_process_is_told_to_connect_anew_and_both_end(twin: Stack) -> None:
    text = """
    import os, gemelo
    arm = gemelo.connect()
    arm.joints
    if os.fork() == 0:
        try:
            arm.joints
        except gemelo.Error as error:
            print(error, flush=True)
        os._exit(7)
    print(os.waitstatus_to_exitcode(os.wait()[1]), len(arm.joints), flush=True)
    """
    with script(twin, text) as process:
        assert said(process).endswith("a forked process calls gemelo.connect() anew")
        assert said(process) == "7 3"
        assert ended(process)[0] == 0


def test_another_arm_than_the_twin_s_is_named(twin: Stack) -> None:
    with pytest.raises(
        gemelo.Lost, match=r'no stepper_gateway of parol6 .*; there is rm1: gemelo\.connect\("rm1"\)'
    ) as lost:
        gemelo.connect("parol6")
    assert lost.value.robots == gemelo.robots() == ("rm1",)
    with pytest.raises(gemelo.BadArgument, match='there is no arm "parol"; did you mean "parol6"'):
        gemelo.connect("parol")
    said: list[str] = []
    for name in ON_THE_STACK:
        example = doctest.DocTestParser().get_doctest(PUBLIC[name], {"gemelo": gemelo}, name, None, 0)
        results = doctest.DocTestRunner(optionflags=OPTIONS).run(example, out=said.append)
        assert (results.attempted > 0, results.failed) == (True, 0), "".join(said)


def test_a_gateway_that_dies_is_lost_within_seconds_and_the_arm_goes_on_when_it_is_back(
    twin: Stack, arm: gemelo.Arm
) -> None:
    arm.move(named="home")
    motion = arm.start(named="left", speed=0.3)
    twin.kill("stepper_gateway")
    began = time.monotonic()
    with pytest.raises(gemelo.Lost):
        motion.wait()
    assert time.monotonic() - began < 5.0
    twin.wait_ready(120.0, ["stepper_gateway"])
    assert arm.device.status.online


def test_a_planner_that_is_away_is_lost_with_its_name(twin: Stack, arm: gemelo.Arm) -> None:
    twin.kill("planner")
    with pytest.raises(gemelo.Lost, match="planner"):
        arm.plan(named="left", allowed_time=0.1)
    twin.wait_ready(120.0, ["planner"])
