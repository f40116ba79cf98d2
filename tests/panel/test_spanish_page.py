"""Every sentence that a part of the twin can say to a person is Spanish on a Spanish page."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import gemelo
from gemelo.programs import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    Output,
    Pick,
    Repeat,
    Speed,
    Wait,
    WaitFor,
)
from gemelo.programs.steps import KINDS
from gemelo.schemas.device import DeviceCommandKind, DeviceFault, DeviceMode, StopKind
from gemelo.schemas.device_faults import fault_text
from gemelo.schemas.motion import FollowErrorCode
from gemelo.services.panel.model.problems import problem_of
from gemelo.services.panel.words.step_text import step_text
from gemelo.services.panel.words.words import LANGUAGES, Words
from gemelo.services.stepper_gateway.device.command_handler import NOT_NOW, REMEDIES, complaint
from gemelo.services.stepper_gateway.device.session import DEAF, ONE_NAME
from gemelo.services.stepper_gateway.links.foreign.ra_device import LOST, SILENT
from gemelo.services.stepper_gateway.links.foreign.text_device import LOST_IN_A_MOTION, MUTE
from gemelo.services.stepper_gateway.links.frames import Code
from tests.table import table

ROOT = Path(__file__).parents[2]
SPANISH, ENGLISH = Words("es"), Words("en")
SAID_WITHIN = "a newer goal took over"  # a sentence that is known, to stand at the places of values
REFUSALS = ("invalid", "invalid_joints", "GoalRejected", "_changed", "GoalEnding", "abort", "stop")
ERRORS = (
    "BadArgument",
    "Refused",
    "Aborted",
    "Error",
    "Lost",
    "Canceled",
    "SceneError",
    "BadStl",
)


def sentences_in(path: Path) -> Iterator[str]:
    """What is refused, raised or returned as a text in the file, with `SAID_WITHIN` for every value."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in (*REFUSALS, *ERRORS):
            for argument in node.args:
                yield from _texts(argument)
        elif isinstance(node, ast.FunctionDef) and node.returns is not None and ast.unparse(node.returns) == "str":
            for inner in ast.walk(node):
                if isinstance(inner, ast.Return) and inner.value is not None:
                    yield from _texts(inner.value)


def _texts(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        text = "".join(map(_part, node.values))
        if re.search(r"\w{2,} \w{2,}", text.replace(SAID_WITHIN, "")):
            yield text
    elif isinstance(node, ast.IfExp | ast.BoolOp):
        for inner in (node.body, node.orelse) if isinstance(node, ast.IfExp) else node.values:
            yield from _texts(inner)


def _part(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return str(node.value)
    expression = ast.unparse(node)
    if "suggestion(" in expression or expression in ("{hint}",):
        return "; known are one, two"
    return SAID_WITHIN


PARTS = [
    *(f"services/stepper_gateway/{room}" for room in ("goals", "device", "control", "gripper", "motion", "core.py")),
    "services/planner/scene",
    *("services/planner/collision/scene_shapes.py", "services/planner/collision/arm_geometry.py"),
    *("libraries/runtime/requests/client.py", "libraries/runtime/requests/limits.py", "libraries/arm/stl.py"),
    *("services/panel/model", "gemelo"),
]
WITHIN_OTHERS = {  # parts of sentences, which are tested as a whole below
    "joint limits": "make the trajectory {} times as long",
    "bounds": "{} (between points, at {} s)",
    "rate": 'joint "{}": {} steps/s at {} s is more than the {} steps/s that its driver and the device can do; {}',
    "velocity": 'joint "{}": {} {}/s at {} s is beyond the velocity limit {} {}/s; {}',
    "point": "{} at point {} ({} s)",
    "followed": "goal {} cannot be followed, {}: plan from where the arm is",
    "scene": "{}: plan again",
    "another scene": "planned in version {} of a scene that the planner holds no more; another one is at version {} "
    "now",
    "older scene": "planned in scene version {}, the scene is version {} now",
    "tolerance": "{}: {} {} is negative; give a bound, 0 for the default or -1 for no bound",
    "acceleration": "{}: an acceleration of {} {}/s^2 cannot be watched, because the device measures steps and "
    "velocities only; give 0 or -1, and bound the velocity",
    "answer": "the device has not answered {} in time, which was sent {} times{}",
    "e-stop": 'the emergency stop "{}" of device "{}" is pressed: release it, {}',
    "e-stop before": 'the emergency stop of device "{}" was pressed: {}',
    "clock": 'the clock of device "{}" is not known yet: {}',
    "devices": '{} devices call themselves "{}": {}: {}',
    "not usable": "the device is {}",
    "heard": 'device "{}" has not been heard: {}',
    "gone": "{} for {} s: take control anew with `gemelo control take --force`",
    "picked": "{} is at {}: seen +-{} mm{}{}, {} s{}",
    "unseen": "{}; not seen afterwards: {}",
    "configuration": "the device refused the configuration: {}{}",
}
NOT_ON_THE_PAGE = {  # of files, logs and clients that a page does not have, and arguments that only a script gives
    "services/stepper_gateway/goals/active_goal.py": ("{}; {}; {} steps from the goal", "{}; nothing moved for it"),
    "services/stepper_gateway/goals/scene_versions.py": ("version {} is ", "it comes from {}", "a process that "),
    "services/stepper_gateway/device/state_checks.py": ("a state that ",),
    "services/stepper_gateway/device/echoes.py": ("too many measurements", "no link to the device", "its longest pass"),
    "gemelo/api/connection.py": ("no {} of {} at the router",),
    "gemelo/api/control_file.py": ("{} belongs to user", "{}: {}: name another file in"),
    "gemelo/api/motion.py": ("{} in {} s{}, final error",),
    "gemelo/api/robot_files.py": ("no router at",),
    "gemelo/api/planning.py": ("{} holds no plan",),
    "gemelo/programs/export.py": ("if __name__",),
    "gemelo/api/session.py": ("this connection belongs to process", "this waits for messages"),
}  # fmt: skip


@table("part", PARTS)
def test_every_sentence_in_the_code_is_said_in_spanish_with_its_values(part: str):
    root, found = ROOT / part, 0
    for path in sorted(root.rglob("*.py")) if root.is_dir() else [root]:
        beginnings = NOT_ON_THE_PAGE.get(str(path.relative_to(ROOT)), ())
        for sentence in sentences_in(path):
            template = sentence.replace("; known are one, two", "{}").replace(SAID_WITHIN, "{}")
            found += 1
            if template not in WITHIN_OTHERS.values() and not template.startswith(beginnings or ("\0",)):
                assert SPANISH.said(sentence) != sentence, f"{path}: {template}"
                assert not english_in(SPANISH.said(sentence)), f"{path}: {template}: {SPANISH.said(sentence)}"
    assert found


def english_in(said: str) -> list[str]:
    """The commonest English words in a sentence that is to be Spanish."""
    return [word for word in (" the ", " is ", " and ", " its ", " run ", " not ") if word in f" {said} "]


def told_in_spanish(english: str) -> str:
    """What a person reads, who must not find English words in it."""
    said = SPANISH.said(english)
    assert said != english, english
    assert not english_in(said), said
    assert "gemelo " not in said
    return said


@table("kind", DeviceCommandKind)
@table("mode", DeviceMode)
def test_every_command_that_the_device_refuses_in_any_mode_with_any_code(kind: DeviceCommandKind, mode: DeviceMode):
    for code in Code:
        told = complaint(kind, SimpleNamespace(code=code, mode=mode))
        said = told_in_spanish(f"{kind.name.lower()} refused: {told}")
        for english in (kind.name, mode.name, code.name):
            assert not re.search(rf"\b{english}\b", said), said


@table("fault", [*(fault for fault in DeviceFault if fault), 99])
@table("joint", ["", "brazo_joint"])
def test_every_fault_has_its_meaning_and_remedy_in_spanish(fault: int, joint: str):
    said = told_in_spanish(fault_text(fault, joint))
    assert joint in said
    assert fault == 99 or DeviceFault(fault).name not in said
    assert told_in_spanish(f'device "x" has a fault: {fault_text(1, joint)}')


@table("code", [code for code in FollowErrorCode if code])
def test_every_code_of_a_goal_is_said_in_spanish_where_its_sentence_is_not_known(code: FollowErrorCode):
    for error in (gemelo.Refused("odd", check="execution", code=code), gemelo.Aborted("odd", code=code)):
        heading, text = SPANISH.problem(problem_of(error))
        assert text != "odd"
        assert "«odd»" in text
        assert heading != ENGLISH.problem(problem_of(error))[0]
        assert ENGLISH.problem(problem_of(error))[1] == "odd"


@table("kind", StopKind)
def test_a_stop_that_is_refused_says_why(kind: StopKind):
    reason = f"a goal is being carried out: cancel it or run `gemelo stop` before {kind.name}"
    refused = gemelo.Refused(f"{kind} refused: {reason} (device mode RUN)", check="device", reason=reason)
    assert SPANISH.problem(problem_of(refused))[1].startswith("El brazo va hacia una meta: pulse Parar antes de ")


BEYOND = 'joint "a": 3.2000 rad is beyond the upper limit 2.9497 rad; stay within -2.9497 to 2.9497 rad'


@table(
    ("english", "spanish"),
    [
        (f"{BEYOND} at point 3 (1.000 s)", "a: 3.2000 rad está más allá del límite superior de 2.9497 rad; quédese "
         "entre -2.9497 y 2.9497 rad (punto 3, a los 1.000 s)."),
        (f"{BEYOND} (between points, at 1.000 s)", "entre dos puntos, a los 1.000 s"),
        ('joint "a": 900 steps/s at 1.000 s is more than the 500 steps/s that its driver and the device can do; make '
         "the trajectory 1.80 times as long", "900 pasos/s a los 1.000 s son más que los 500"),
        ('joint "a": 2.0000 rad/s at 1.000 s is beyond the velocity limit 1.0000 rad/s; make the trajectory 2.00 times '
         "as long", "su límite de velocidad, 1.0000 rad/s: vaya 2.00 veces más despacio"),
        ("goal g1 cannot be followed, it ended ABORTED: plan from where the arm is", "(antes de la meta)"),
        ("goal g1 cannot be followed, it is not under way: plan from where the arm is", "ya no está en marcha"),
        ("planned in scene version 3, the scene is version 4 now: plan again", "en la versión 3 de la escena"),
        ("planned in version 3 of a scene that the planner holds no more; another one is at version 1 now: plan again",
         "versión 3 de una escena que ya no hay"),
        ('goal_tolerance of joint "a": position -2 is negative; give a bound, 0 for the default or -1 for no bound',
         "position -2 es negativo"),
        ('path_tolerance of joint "a": an acceleration of 3 rad/s^2 cannot be watched, because the device measures '
         "steps and velocities only; give 0 or -1, and bound the velocity", "una aceleración de 3 rad/s^2"),
        ("the device has not answered ARM in time, which was sent 3 times", "a encender los motores, que se le envió "
        "3"),
        ('the device has not answered HOME in time, which was sent 3 times: device "x" is offline: switch it on, or '
         "check its network", "no está conectado"),
        ('the emergency stop "estop" of device "x" is pressed: release it, run `gemelo reset`, `gemelo device arm`, '
        'then '
         "`gemelo home` or `gemelo reference`", "«estop» del equipo «x» está pulsada"),
        ("ana (node cli-1 on desk), who holds control, is gone for 1.2 s: take control anew with `gemelo control take "
         "--force`", "ana (node cli-1 on desk), que tiene el mando"),
        ("refused by stepper_gateway: ana holds control of rm1, since 09:10:11 UTC (12 s ago), from node cli-1 on "
        "desk: "
         "ask for it, or run `gemelo control take --force`", "ana tiene el mando de rm1 desde las 09:10:11 UTC (hace "
         "12"),
        ('the device is not usable: two devices call themselves "rm1": boot 00000001 (virtual); boot 00000002 (board): '
         f"{ONE_NAME}", "se llama «rm1» (boot 00000001 (virtual); boot 00000002 (board))"),
        (SILENT.format(silence=0.31), "El sketch calló 0.31 s con un mensaje por hacer"),
        (LOST, "El broker no entregó el último mensaje de pasos"),
        (f'no link to device "rm1": {MUTE.format(silence=1.2, baud=115200)} (port /dev/ttyUSB0)',
         "trabaja la placa a 115200 baudios?"),
        (LOST_IN_A_MOTION.format(mute=MUTE.format(silence=1.2, baud=115200)), "Estaba en movimiento y no se sabe"),
        (f'device "rm1" {DEAF} (for 12 s)', "Sin latidos se detiene solo. (desde hace 12 s)"),
        ("cup is not seen by overhead, and nothing else: is it in the image, lit, and not behind the arm? `gemelo "
         "camera view`", "overhead no ve cup, ni nada más"),
        ("cup is not seen by overhead, which see red_block: is it in the image, lit, and not behind the arm? `gemelo "
         "camera view`", "ve red_block"),
        ("cup is at bin: seen +-0.4 mm, turned 3 deg by the jaws, at attempt 2, 9.1 s", "cup está en bin"),
        ("cup is at bin: seen +-0.4 mm, 9.1 s; not seen afterwards: cup is not seen by overhead, and nothing else: is "
         "it in the image, lit, and not behind the arm? `gemelo camera view`", "9.1 s; después no se vio: overhead no "
         "ve cup"),
        ("gripper: 20.0 mm, stopped by what is between the jaws (commanded, not measured), holds cup", "lleva cup"),
        ('refused: object "x": its data is no usable STL file: it is no STL file: 17 bytes that are neither the binary '
         "form nor begin with solid", "«x»: el archivo no sirve. No es un archivo STL (17 bytes)."),
        ('the emergency stop of device "x" was pressed: run `gemelo reset`, `gemelo device arm`, then `gemelo home` or '
         "`gemelo reference`", "Se pulsó la parada de emergencia del equipo «x»"),
        ('device "x" has not been heard: is it switched on, does it use the same broker, and does the broker\'s ACL '
         "let it write?", "Aún no se oye al equipo «x»"),
        ('the clock of device "x" is not known yet: try again in a second', "Aún no se conoce el reloj del equipo «x»"),
        ("cup: it is seen 2 times: take the others away, or give each a tag of its own", "cup: se ve 2 veces"),
        ("aborted after 2.10 s: the device holds because it lost the gateway's heartbeat; then stopped by a device "
         "command (DISARM)", "Luego: Lo detuvo una orden al equipo (apagar los motores)."),
    ],
)  # fmt: skip
def test_sentences_that_are_put_together_keep_their_values(english: str, spanish: str):
    assert spanish in told_in_spanish(english)


def test_a_sentence_around_one_that_is_not_known_is_left_as_it_came():
    assert LANGUAGES["es"].sentences.of("refused by stepper_gateway: never heard of before") is None
    assert LANGUAGES["es"].sentences.of("FAULTY: nobody: knows; this") is None
    assert SPANISH.said("never heard of before") == "never heard of before"


def test_what_the_gateway_and_the_device_say_to_do_is_to_press_buttons_in_both_languages():
    for text in (*REMEDIES.values(), *NOT_NOW.values(), fault_text(DeviceFault.EMERGENCY_STOP)):
        told_in_spanish(text)
        assert re.findall("`gemelo ([^`]*)`", ENGLISH.said(text)) in ([], ["device config"])
    assert ENGLISH.said("run `gemelo device arm`, and wait") == "press “Switch the drivers on”, and wait"
    assert ENGLISH.said("release it, `gemelo reset`") == "release it, “Reset the fault”"


STEPS: tuple[tuple[AnyStep, str, str], ...] = (
    (Go(point="P1", blend=0.01), "go to P1, blend 10 mm", "ir a P1, redondeo 10 mm"),
    (Go(joints={"a": 0.5}), "go to joint values", "ir a valores de articulaciones"),
    (Line(state="home", tool_speed=0.05), "line to home, 50 mm/s", "recta hasta home, 50 mm/s"),
    (Line(offset=(0.0, 0.0, 0.02)), "line to 0 0 20 mm further", "recta hasta 0 0 20 mm más allá"),
    (Arc(position=(0.1, 0.2, 0.3), through=(0.1, 0.1, 0.3)), "arc to 100 200 300 mm", "arco hasta 100 200 300 mm"),
    (Output(name="pump", on=True), "output pump on", "salida pump encendida"),
    (Output(name="pump", on=False), "output pump off", "salida pump apagada"),
    (Grip(to="open"), "gripper to open", "pinza a abierta"),
    (Grip(to=0.02), "gripper to 20 mm", "pinza a 20 mm"),
    (Pick(thing="cup", place="bin"), "pick cup → bin", "recoger cup → bin"),
    (Wait(time=1.5), "wait 1.5 s", "esperar 1.5 s"),
    (WaitFor(sensor="ultra", above=0.25), "wait for a sensor ultra > 0.25", "esperar a un sensor ultra > 0.25"),
    (WaitFor(sensor="ultra", below=0.0), "wait for a sensor ultra < 0", "esperar a un sensor ultra < 0"),
    (Speed(share=0.5), "speed 50 %", "velocidad 50 %"),
    (Attach(object="box"), "attach box", "sujetar box"),
    (Detach(object="box"), "detach box", "soltar box"),
    (Repeat(count=3, steps=()), "repeat 3 times", "repetir 3 veces"),
    (Call(program="tour"), "call a program tour", "llamar a un programa tour"),
)


def test_every_kind_of_step_is_told_in_the_language_of_the_page_and_in_millimetres():
    assert {type(step) for step, *_ in STEPS} == set(KINDS)
    for step, english, spanish in STEPS:
        assert step_text(step, ENGLISH) == english
        assert step_text(step, SPANISH) == spanish
