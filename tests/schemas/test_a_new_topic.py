"""A topic is one row of the table and a verb: here one is added, in a process of its own, and everything follows."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).parents[2]
WITH_ONE_ROW_MORE = """
import importlib.util, sys

spec = importlib.util.find_spec("gemelo.schemas.topics")
source = open(spec.origin).read()
row = 'WEATHER = Topic("weather", joints.JointState, LATEST, 10.0, True, PLANNER, "how warm it is", (DETECTOR,))'
begin = source.index("TOPICS: tuple[")
module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
exec(compile(source[:begin] + row + chr(10) + source[begin:], spec.origin, "exec"), module.__dict__)
"""


def with_one_row_more(*lines: str) -> str:
    """The output of a process in which a topic WEATHER of the planner's stands in the table."""
    code = WITH_ONE_ROW_MORE + "".join(textwrap.dedent(each) for each in lines)
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_who_writes_and_reads_it_follows_from_its_row():
    said = with_one_row_more("""
        from gemelo.libraries.runtime.permissions import permissions
        from gemelo.schemas.roles import ROLES

        may = {role.name: permissions(role) for role in ROLES}
        print(*sorted(name for name in may if "weather" in may[name].publishes))
        print(*sorted(name for name in may if "weather" in may[name].subscribes))
    """)
    writers, readers = said.splitlines()
    assert writers == "planner"
    assert readers == "detector logger operator panel script viewer"


def test_it_is_recorded_and_the_command_line_knows_it():
    assert with_one_row_more("""
        from gemelo.libraries.recordings.table import recorded_topics
        from gemelo.schemas.topics import WEATHER
        from gemelo.tools.cli.bus.living_topics import known_topic

        print(WEATHER in recorded_topics(), known_topic("weather") is WEATHER)
    """) == "True True\n"  # fmt: skip


def test_a_verb_at_either_end_is_all_that_it_takes():
    assert with_one_row_more("""
        from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
        from gemelo.libraries.runtime.node import Node
        from gemelo.schemas.deployment import Deployment
        from gemelo.schemas.joints import JointState
        from gemelo.schemas.topics import WEATHER

        network, deployment, came = MemoryNetwork(), Deployment(), []
        with (
            Node("planner", deployment, robot="rm1", bus=MemoryBus(network)) as writer,
            Node("detector", deployment, robot="rm1", bus=MemoryBus(network)) as reader,
        ):
            reader.subscribe(WEATHER, lambda message: (came.append(message), reader.stop()))
            writer.publisher(WEATHER).put(JointState(name=("air",), position=(293.15,)))
            reader.spin(lambda now: None, rate=50.0)
            print(came[0].name[0], came[0].position[0])
    """) == "air 293.15\n"  # fmt: skip
