"""Roles against the code: a service uses only keys that its role may; a missing one shows here, not on a site."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.recordings.table import NODES, recorded_topics
from gemelo.libraries.runtime.actions.keys import goal_request
from gemelo.libraries.runtime.permissions import permissions
from gemelo.schemas import topics
from gemelo.schemas.roles import role
from gemelo.schemas.topics import DEVICE_CONFIGURE, DEVICE_INJECT, Action, Request, Topic
from tests.runtime.support import ROOT

VERBS = {
    "publisher": "publishes", "subscribe": "subscribes", "latest": "subscribes", "newest": "subscribes",
    "serve": "serves", "serve_later": "serves", "serve_action": "serves",
    "call": "asks", "ask": "asks", "action": "asks", "Feed": "subscribes",
}  # fmt: skip
OF_NOBODY = {DEVICE_CONFIGURE.key, DEVICE_INJECT.key}  # what `gemelo` can ask and a script may not
FOLDERS = (
    ("services/stepper_gateway", "gateway", 5), ("services/planner", "planner", 12),
    ("services/state_publisher", "state_publisher", 4), ("services/visualizer", "visualizer", 13),
    ("services/ros_bridge", "ros_operator", 8), ("services/camera", "camera", 3), ("services/detector", "detector", 1),
    ("gemelo", "operator", 20), ("gemelo", "panel", 20), ("gemelo", "script", 20), ("tools/cli", "operator", 15),
)  # fmt: skip


def uses(folder: Path) -> Iterator[tuple[str, str]]:
    """`("subscribes", "joint_states")` for every call in the folder that names a row of the tables."""
    for file in folder.rglob("*.py"):
        for call in (each for each in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(each, ast.Call)):
            named = call.args[0] if call.args else None
            verb = VERBS.get(getattr(call.func, "attr", getattr(call.func, "id", "")))
            if verb is not None and isinstance(named, ast.Name):
                row = getattr(topics, named.id, None)
                if isinstance(row, Action):
                    yield verb, goal_request(row).key
                elif isinstance(row, Topic | Request):
                    yield verb, row.key


@pytest.mark.parametrize(("folder", "name", "least"), FOLDERS)
def test_a_role_may_do_what_its_code_does(folder, name, least):
    may, found = permissions(role(name)), set(uses(ROOT / folder))
    lacking = {(verb, key) for verb, key in found if key not in getattr(may, verb)}
    assert {key for _, key in lacking} <= (OF_NOBODY if name == "script" else set())
    assert len(found) >= least, found


def test_the_logger_may_hear_what_it_records():
    recorded = {topic.key for topic in recorded_topics() if topic is not NODES}  # those it asks for itself
    assert recorded <= permissions(role("logger")).subscribes
