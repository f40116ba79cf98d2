"""The page's model, without a browser and without a twin."""

from __future__ import annotations

import ast
import math
import re
import string
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

import gemelo
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.programs import AnyStep, Program, Repeat, RunStatus, StepPath, Wait
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.panel.model.availability import CHECKS
from gemelo.services.panel.model.goal import GoalSolver
from gemelo.services.panel.model.problems import Problem, problem_of
from gemelo.services.panel.model.teaching import deleted, inserted, shifted
from gemelo.services.panel.model.tool_turns import ALL_RINGS, NO_RINGS, ToolTurns, tool_turns
from gemelo.services.panel.model.units import in_degrees
from gemelo.services.panel.view.browser import CHANNEL, Browser, read_browser, script_html
from gemelo.services.panel.view.obstacles import nearest_hit
from gemelo.services.panel.words.en import ENGLISH
from gemelo.services.panel.words.language import Language
from gemelo.services.panel.words.words import LANGUAGES, Words, language_of
from tests.arm.bare_arm import ROBOT
from tests.runtime.support import until

PANEL = Path(__file__).parents[2] / "services/panel"
READY = DeviceState(mode=DeviceMode.IDLE, armed=True, referenced=(True, True), name=("a", "b"))


def fields(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


@pytest.mark.parametrize("language", LANGUAGES.values(), ids=LANGUAGES)
def test_every_language_has_every_word_with_the_same_values_to_put_in(language: Language):
    assert ENGLISH.keys() == language.table.keys()
    for key, text in ENGLISH.items():
        assert fields(text) == fields(language.table[key]), key
        assert language.table[key].strip()


def test_every_word_that_the_page_asks_for_is_in_the_tables():
    asked = {key for path in PANEL.rglob("*.py") for key in re.findall(r"words\(\s*\"([a-z_0-9]+)\"", path.read_text())}
    assert len(asked) > 60
    assert asked - {"key"} <= ENGLISH.keys()


def test_every_reason_and_every_mode_has_its_words():
    states = [
        replace(READY, mode=mode, armed=armed, referenced=known, fault=fault)
        for mode in DeviceMode
        for armed in (True, False)
        for known in ((True, True), (True, False))
        for fault in (0, 3)
    ]
    for language in ("en", "es"):
        words = Words(language)
        assert all(words.reason(check(state)) is not None for check in CHECKS.values() for state in states)
        assert all(words(f"mode_{mode.name.lower()}") for mode in DeviceMode)


@pytest.mark.parametrize("language", ["en", "es"])
def test_every_end_of_a_motion_and_of_a_program_has_its_words(language: str):
    words = Words(language)
    ends = [words.ended(status) for status in GoalStatusCode]
    assert all(ends)
    lost = [end for status, end in zip(GoalStatusCode, ends, strict=True) if not status.is_terminal]
    assert set(lost) == {words("ended_unknown")}  # its gateway was lost on the way
    assert all(words(f"run_{status.value}") for status in RunStatus)


def test_what_cannot_be_done_now_says_why():
    assert CHECKS["move"](READY) is None
    assert CHECKS["move"](replace(READY, armed=False)) == ("drivers_off", "")
    assert CHECKS["move"](replace(READY, referenced=(True, False))) == ("unreferenced", "b")
    assert CHECKS["move"](replace(READY, mode=DeviceMode.ESTOP)) == ("in_fault", "ESTOP")
    assert CHECKS["reset"](READY) == ("no_fault", "")
    assert CHECKS["reset"](replace(READY, mode=DeviceMode.FAULT)) is None


@pytest.mark.parametrize(
    ("told", "language"), [("es-MX", "es"), ("es", "es"), ("en-GB", "en"), ("fr", "en"), ("", "en")]
)
def test_a_browser_s_language_is_the_nearest_of_ours(told: str, language: str):
    assert language_of(told) == language


def test_a_refusal_keeps_its_check_its_sentence_and_what_can():
    refused = gemelo.Refused("too far", check="reach", nearest=gemelo.Target(position=(0.1, 0.2, 0.3)), remedy="nearer")
    problem = problem_of(refused)
    assert (problem.check, problem.text, problem.has_nearest, problem.is_refusal) == ("reach", "too far", True, True)
    assert Words("es").problem(problem) == ("Fuera de alcance", "too far")
    assert not problem_of(gemelo.Aborted("stopped")).is_refusal
    assert Words("en").problem(Problem("odd", "never heard of")) == ("Refused", "odd")
    assert "ZeroDivisionError" in problem_of(ZeroDivisionError("x")).text


def checks(folder: str) -> set[str]:
    """Every check that is named where something is refused or limited."""
    found = set()
    places = {"StopReason": 0, "_jump": 0, "unknown_name": 1, "refusal_of": 1, "malformed": 3}
    for path in (PANEL.parents[1] / folder).rglob("*.py"):
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call):
                given = {word.arg: word.value for word in call.keywords} | dict(enumerate(call.args))
                check = given.get(places.get(ast.unparse(call.func).split(".")[-1], "check"), given.get("check"))
                for each in (check.body, check.orelse) if isinstance(check, ast.IfExp) else (check,):
                    if isinstance(each, ast.Constant) and isinstance(each.value, str) and each.value:
                        found.add(each.value)
    return found


OTHERS = {"pull-out torque", "step rate", "pulse width", "collision", "self-collision"}  # that stand in a variable


def test_every_check_has_its_name_in_both_languages():
    named = checks("services/planner") | checks("gemelo") | OTHERS
    assert {"joint limit", "device queue", "jump", "unknown planner", "virtual"} <= named
    assert len(named) > 40
    for check in named:
        assert Words("en").check(check), check
        assert Words("es").check(check), check


NEAR = {"first": "efector_link", "first_kind": "link", "second": "post", "second_kind": "box", "limit": 0.004}


@pytest.mark.parametrize(
    ("reason", "english", "spanish"),
    [
        (
            because("plan.limit.position", joint="codo", value=math.pi, beyond=0.19, limit=math.radians(169.0),
                    side="upper", unit="rad", file="robot.urdf"),
            "codo: 180.0° is beyond its upper limit of 169.0°.",
            "codo: 180.0° está más allá de su límite superior de 169.0°.",
        ),
        (
            because("plan.start.moving", remedy("wait_or_cancel"), joint="eje", velocity=0.01, limit=0.001, unit="m"),
            "eje moves at 10.0 mm/s, and a plan begins at rest (below 1.0 mm/s); wait, or press Stop.",
            "eje se mueve a 10.0 mm/s, y un plan empieza en reposo (por debajo de 1.0 mm/s); espere, o pulse Parar.",
        ),
        (
            because("plan.collision.goal", because("plan.pair.inside", depth=0.0343, **NEAR)),
            "at the goal, link efector_link and box post would touch: 34.3 mm of one inside the other.",
            "En la meta, el eslabón efector_link y la caja post se tocarían: 34.3 mm uno dentro del otro.",
        ),
        (
            because("plan.collision.line", because("plan.pair.apart", distance=0.0012, **NEAR)),
            "on the straight path to the goal, link efector_link and box post would be 1.2 mm apart; 4 mm must stay "
            "free.",
            "En el camino recto a la meta, el eslabón efector_link y la caja post quedarían a 1.2 mm; deben quedar "
            "4 mm libres.",
        ),
        (
            because("plan.tool.stopped_turning", because("plan.tool.singular", manipulability=0.01), share=0.402),
            "at 40.2 % of the turn along the path, the arm is stretched out or its axes line up (singularity, "
            "manipulability 0.01).",
            "Al 40.2 % del giro, el brazo queda estirado o con dos ejes alineados (singularidad, manipulabilidad "
            "0.01).",
        ),
        (
            because("plan.tool.stopped", because("plan.tool.jump", joint="codo", value=math.pi, limit=0.5, unit="rad",
                                                 manipulability=0.01), gone=0.1, whole=0.16),
            "at 100.0 mm of 160.0 mm along the path, codo would have to jump by 180.0° there, more than 28.6°.",
            "A los 100.0 mm de los 160.0 mm del camino, codo tendría que saltar ahí 180.0°, más de 28.6°.",
        ),
    ],
)  # fmt: skip
def test_refusals_of_the_planner_are_said_in_the_units_of_the_page(reason: Reason, english: str, spanish: str):
    problem = problem_of(gemelo.Refused("refused (a check): in English", check="a check", reason=reason))
    assert Words("en").problem(problem)[1] == english
    assert Words("es").problem(problem)[1] == spanish


def wrist(folder: Path, axis: str) -> ArmDescription:
    """A SCARA whose tool a fourth joint turns about `axis`."""
    joints = (("a", "base", "one", "revolute", "0 0 0"), ("b", "one", "two", "revolute", "0.2 0 0"),
              ("c", "two", "three", "prismatic", "0.2 0 0"), ("d", "three", "hand", "revolute", "0 0 0"))  # fmt: skip
    return bare(folder, joints, {name: axis if name == "d" else "0 0 1" for name, *_ in joints})


def bare(folder: Path, joints: tuple[tuple[str, ...], ...], axes: dict[str, str]) -> ArmDescription:
    """An arm of joints (name, parent, child, kind, origin) that turn or slide along their axes."""
    texts = [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axes[name]}"/><limit lower="-2" upper="2" effort="9" velocity="1"/></joint>'
        for name, parent, child, kind, at in joints
    ]
    links = "".join(f'<link name="{name}"/>' for name in ("base", *(joint[2] for joint in joints)))
    (folder / "robot.urdf").write_text(f'<robot name="bare">{links}{"".join(texts)}</robot>')
    (folder / "robot.toml").write_text(ROBOT)
    values = "".join(f'<joint name="{joint[0]}" value="0"/>' for joint in joints)
    (folder / "robot.srdf").write_text(
        f'<robot name="bare"><group name="arm"><chain base_link="base" tip_link="hand"/></group>'
        f'<group_state name="home" group="arm">{values}</group_state></robot>'
    )
    return load_arm(folder)


def test_the_gizmo_turns_only_what_the_arm_can(tmp_path: Path):
    ours = {name: load_arm(Path(__file__).parents[2] / "urdf" / name) for name in ("rm1", "parol6")}
    assert tool_turns(ours["rm1"]) == ToolTurns(NO_RINGS, keeps_orientation=False)
    assert tool_turns(ours["parol6"]) == ToolTurns(ALL_RINGS, keeps_orientation=True)
    assert tool_turns(wrist(tmp_path, "0 0 -1")) == ToolTurns((False, False, True), keeps_orientation=True)
    assert tool_turns(wrist(tmp_path, "1 0 0")) == ToolTurns((True, False, False), keeps_orientation=False)


@pytest.mark.parametrize(("axis", "rings"), [("0 0 1", (False, False, True)), ("1 0 0", (True, False, False))])
def test_five_joints_turn_the_tool_about_the_axis_of_the_last_one(tmp_path: Path, axis: str, rings: tuple[bool, ...]):
    arm = five_joints(tmp_path, axis)
    assert tool_turns(arm) == ToolTurns(rings, keeps_orientation=False)


def test_the_arrows_of_five_joints_lead_the_place_and_their_ring_the_orientation(tmp_path: Path):
    asked: list[set[str]] = []
    arm = five_joints(tmp_path, "0 0 1")
    still, pose = dict.fromkeys(arm.joint_names, 0.0), gemelo.Pose((0.1, 0.0, 0.5))

    def ik(near: dict[str, float], **target: object) -> list[dict[str, float]]:
        asked.append(set(target))
        return [near]

    stub = SimpleNamespace(description=arm, joints=still, fk=lambda joints: pose, ik=ik, check=lambda joints: None)
    solver = GoalSolver(stub, lambda: None)
    try:
        for number, is_turned in enumerate((False, True), start=1):
            solver.set_pose(pose, is_turned=is_turned)
            assert until(lambda number=number: solver.solved == number)
    finally:
        solver.close()
    assert asked == [{"position"}, {"pose"}]


def five_joints(folder: Path, axis: str) -> ArmDescription:
    """A vertical arm: it turns on its base, has three parallel joints, and rolls its tool about `axis`."""
    joints = (("a", "base", "one", "revolute", "0 0 0.1"), ("b", "one", "two", "revolute", "0 0 0.1"),
              ("c", "two", "three", "revolute", "0 0 0.2"), ("d", "three", "four", "revolute", "0 0 0.2"),
              ("e", "four", "hand", "revolute", "0.05 0 0.1"))  # fmt: skip
    axes = {"a": "0 0 1", "e": axis}
    return bare(folder, joints, {name: axes.get(name, "0 1 0") for name, *_ in joints})


def test_what_a_browser_tells_is_read_and_rubbish_is_not():
    told = read_browser(
        f'{CHANNEL} {{"sent": 12.0, "language": "es", "rate": 60, "dark": true, "width": 9, "height": 8}}'
    )
    assert told == Browser(12.0, "es", 60.0, True, 9, 8)
    for text in ("", CHANNEL, f"{CHANNEL} {{", f'{CHANNEL} {{"sent": "x"}}', "hello"):
        assert read_browser(text) is None
    assert "<script" not in script_html()


STEPS = st.recursive(
    st.lists(st.integers(0, 99).map(lambda number: Wait(time=float(number))), max_size=4).map(tuple),
    lambda inner: st.lists(
        st.one_of(
            st.integers(0, 99).map(lambda number: Wait(time=float(number))),
            inner.map(lambda steps: Repeat(count=2, steps=steps)),
        ),
        max_size=4,
    ).map(tuple),
    max_leaves=6,
)


def places(steps: tuple[AnyStep, ...]) -> list[StepPath]:
    return [path for path, _ in Program("p", steps).all_steps()]


def waits(steps: tuple[AnyStep, ...]) -> list[float]:
    return [step.time for _, step in Program("p", steps).all_steps() if isinstance(step, Wait)]


@given(steps=STEPS, data=st.data())
def test_a_step_that_is_taken_out_and_put_back_leaves_the_program_as_it_was(
    steps: tuple[AnyStep, ...], data: st.DataObject
):
    paths = places(steps)
    if paths:
        path = data.draw(st.sampled_from(paths))
        step = Program("p", steps).step(path)
        assert inserted(deleted(steps, path), path, step) == steps


@given(steps=STEPS, data=st.data(), by=st.sampled_from([-1, 1]))
def test_a_step_that_is_moved_is_the_only_one_that_moves_and_comes_back(
    steps: tuple[AnyStep, ...], data: st.DataObject, by: int
):
    paths = places(steps)
    if not paths:
        return
    path = data.draw(st.sampled_from(paths))
    step = Program("p", steps).step(path)
    to = shifted(steps, path, by)
    moved = inserted(deleted(steps, path), to, step)
    assert Program("p", moved).step(to) == step
    assert sorted(waits(moved)) == sorted(waits(steps))
    assert deleted(moved, to) == deleted(steps, path)
    if to != path:
        back = shifted(moved, to, -by)
        assert inserted(deleted(moved, to), back, step) == steps


@given(
    at=st.tuples(*[st.floats(-0.9, 0.9)] * 2),
    origin=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.5, 3.0)),
)
def test_a_ray_meets_the_triangle_that_it_is_aimed_at(at: tuple[float, float], origin: tuple[float, float, float]):
    corners = np.array([[[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]]])
    aim = np.array([*at, 0.0]) - np.array(origin)
    distance = float(np.linalg.norm(aim))
    assert nearest_hit(np.array(origin), aim / distance, corners) == pytest.approx(distance)
    assert nearest_hit(np.array(origin), -aim / distance, corners) == np.inf


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("joint a at -1.5708 rad, limit 3.14159 rad", "joint a at -90.00 °, limit 180.00 °"),
        ("faster than 0.5 rad/s", "faster than 28.65 °/s"),
        ("between 0 and 1 rad of 2 m", "between 0.00 and 57.30 ° of 2 m"),
        ("3 radios, 1 m", "3 radios, 1 m"),
    ],
)
def test_a_line_of_the_log_has_its_angles_in_degrees(text: str, told: str) -> None:
    assert in_degrees(text) == told


def test_a_reason_with_a_code_is_said_in_the_language_and_units_of_the_page() -> None:
    reason = because(
        "goal.start.elsewhere", remedy("plan_from_here"),
        joint="brazo_joint", unit="rad", start=0.5, present=0.25, distance=0.25, tolerance=0.01,
    )  # fmt: skip
    problem = Problem("refused by stepper_gateway: ...", "execution", reason=reason)
    assert Words("es").problem(problem)[1] == (
        "brazo_joint: el plan empieza en 28.6° y el brazo está en 14.3°, a 14.3°; se permiten 0.6°; planifique desde "
        "donde está el brazo."
    )
