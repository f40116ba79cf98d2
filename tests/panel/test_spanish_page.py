"""Every sentence that a part of the twin can say to a person is Spanish on a Spanish page."""

from __future__ import annotations

import re
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
    Play,
    Repeat,
    Speed,
    Wait,
    WaitFor,
)
from gemelo.programs.steps import KINDS
from gemelo.schemas.device import DeviceCommandKind, DeviceFault, DeviceMode, StopKind
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.reasons import Reason, because, plain, remedy
from gemelo.services.panel.model.problems import problem_of
from gemelo.services.panel.words.step_text import step_text
from gemelo.services.panel.words.words import Words
from gemelo.services.stepper_gateway.device.command_handler import NOT_NOW, REMEDIES, complaint
from gemelo.services.stepper_gateway.links.frames import Code
from tests.table import table

ROOT = Path(__file__).parents[2]
SPANISH, ENGLISH = Words("es"), Words("en")


def english_in(said: str) -> list[str]:
    """The commonest English words in a sentence that is to be Spanish."""
    return [word for word in (" the ", " is ", " and ", " its ", " run ", " not ") if word in f" {said} "]


def spanish(said: str) -> str:
    """The sentence, which has no common English word and no command in it."""
    assert not english_in(said), said
    assert "gemelo " not in said
    return said


@table("kind", DeviceCommandKind)
@table("mode", DeviceMode)
def test_every_command_that_the_device_refuses_in_any_mode_with_any_code(kind: DeviceCommandKind, mode: DeviceMode):
    for code in Code:
        said = SPANISH.why(complaint(kind, SimpleNamespace(code=code, mode=mode)))
        assert not english_in(said), said
        for english in (kind.name, mode.name, code.name):
            assert not re.search(rf"\b{english}\b", said), said


@table("fault", [*(fault for fault in DeviceFault if fault), 99])
@table("joint", ["", "brazo_joint"])
def test_every_fault_has_its_meaning_and_remedy_in_spanish(fault: int, joint: str):
    reason = fault_reason(fault, joint)
    assert reason is not None
    said = spanish(SPANISH.why(reason))
    assert joint in said
    assert fault == 99 or DeviceFault(fault).name not in said


@table("kind", StopKind)
def test_a_stop_that_is_refused_says_why(kind: StopKind):
    why = because("command.goal_active", command=kind.name)
    refused = gemelo.Refused(f"{kind} refused: {why} (device mode RUN)", check="device", reason=why)
    assert SPANISH.problem(problem_of(refused))[1].startswith("El brazo va hacia una meta: pulse PARAR antes de ")


CUP = {"thing": "cup", "place": "bin", "error": 0.4, "time": 9.1}
SEEN = because("detect.seen", thing="cup", kind="tag", at=(260.0, 160.0, 40.0), error=0.1, camera="overhead")
UNSEEN = because("detect.not_seen", remedy("view_camera"), thing="cup", cameras="overhead")
HELD = because("gripper.ended.holds", opening=20.0, how="stopped_commanded", object="cup")


@table(
    ("line", "expected"),
    [
        (SEEN, "cup (etiqueta): 260.0 160.0 40.0 mm, +-0.10 mm por overhead"),
        (because("detect.seen.unfit", SEEN, because("detect.twice", count=2)), "por overhead: se ve 2 veces"),
        (because("pick.place", place="bin", at=(1.0, 2.0, 3.0)), "bin: 1.0 2.0 3.0 mm"),
        (because("pick.above"), "encima"),
        (because("pick.gripper", HELD), "pinza: 20.0 mm, la detuvo lo que hay entre las mordazas (mandada, no medida), "
         "lleva cup"),
        (because("pick.done.turned_again", angle=3.0, count=2, **CUP),
         "girada 3° por las mordazas, al intento 2, 9.1 s"),
        (because("pick.done.unseen", because("pick.done", **CUP), UNSEEN), "9.1 s; después no se vio: no se ve "
         "cup con overhead, ni nada más"),
    ],
)  # fmt: skip
def test_the_lines_of_a_pick_are_spanish_with_their_values(line: Reason, expected: str):
    assert expected in spanish(SPANISH.line(line))


OFFLINE = because("device.offline", device="x")
HOLDER = {"name": "ana", "node": "cli-1", "host": "desk"}
VIRTUAL = because("device.boot.reported", boot="00000001", kind="virtual", firmware="1.0.0")


@table(
    ("reason", "expected"),
    [
        (because("command.unanswered", command="ARM", count=3), "a encender los motores, que se le envió 3 veces"),
        (because("command.unanswered.unreachable", OFFLINE, command="HOME", count=3), "3 veces: el equipo «x» no está"),
        (because("command.last_state.stands", OFFLINE, age=1.25, mode="IDLE"), "hace 1.2 s, está quieto y en reposo."),
        (because("device.estop.pressed", remedy("release_and_reset"), device="x", input="estop"),
         "«estop» del equipo «x» está pulsada: suéltela, pulse «Borrar el fallo» y «Encender los motores»"),
        (because("device.estop.was_pressed", remedy("reset_and_reference"), device="x"), "Se pulsó la parada"),
        (because("device.disarmed", remedy("home_or_reference"), device="x"),
         "pulse «Encender los motores»; luego pulse «Buscar el origen», o ponga el brazo en su posición de referencia"),
        (because("device.unreferenced", remedy("reference_by_hand"), device="x", joints=("a", "b")), "está a, b: "),
        (because("device.several", VIRTUAL, because("device.boot", boot="00000002"), device="rm1", number="two"),
         "Hay dos equipos que se llaman «rm1» (arranque 00000001 (virtual, firmware 1.0.0); arranque 00000002)"),
        (because("device.for_time", because("device.deaf", device="rm1"), time=12.0), "solo (desde hace 12 s)."),
        (because("device.never_received", device="x"), "Aún no llega nada del equipo «x»"),
        (because("device.clock_unknown", device="x"), "Aún no se conoce el reloj del equipo «x»"),
        (because("device.held", device="x"), "pulse antes «Continuar» o PARAR."),
        (because("control.holder_gone.anew", time=1.2, **HOLDER), "ana (nodo cli-1 de desk), que tiene el mando, "),
        (because("control.held", robot="rm1", clock="09:10:11", age=12.0, **HOLDER),
         "ana tiene el mando de rm1 desde las 09:10:11 UTC (hace 12 s), en el nodo cli-1 de desk: pídaselo, o pulse "
         "«Quitar el mando a quien lo tiene»."),
        (because("ended.aborted", because("ending.then", because("ending.held.heartbeat"),
                                          because("ending.command", command="DISARM")), time=2.1),
         "Terminó antes de la meta, tras 2.10 s: el equipo se detuvo porque dejaron de llegarle los latidos de "
         "stepper_gateway; luego lo detuvo una orden al equipo (apagar los motores)."),
        (because("ending.off_velocity", joint="a", time=0.5, error=0.1, bound=0.05, unit="rad"),
         "a se apartó 5.7°/s de su velocidad a los 0.500 s; se permiten 2.9°/s."),
        (because("ending.before_it", because("ending.canceled"), goal="g1", status="CANCELED"),
         "terminó antes (cancelado): el brazo frenó sobre su camino."),
        (because("gripper.opening.beyond", value=0.06, closed=0.0, open=0.05), "60 mm no está entre 0 mm (cerrada)"),
        (because("ledger.doubt.load", remedy("reference_joint", joint="a"), joint="a", by="switch", load=0.21),
         "a, verificada por su interruptor: se le pidió el 21 % de su par máximo: no tiene interruptor: pulse"),
    ],
)  # fmt: skip
def test_a_reason_of_the_gateway_is_spanish_on_the_page_with_its_values_and_buttons(reason: Reason, expected: str):
    assert expected in spanish(SPANISH.why(reason))


def test_the_sentence_of_an_older_program_is_left_as_it_came():
    assert SPANISH.problem(problem_of(gemelo.Refused("never seen before", check="execution")))[1] == "never seen before"


def test_what_the_gateway_and_the_device_say_to_do_is_to_press_buttons_in_both_languages():
    remedies = [remedy(code) for code in (*REMEDIES.values(), *NOT_NOW.values())]
    reasons = [because("command.refused", each, command="HOME", mode="RUN", answer="NOT_READY") for each in remedies]
    for reason in (*reasons, fault_reason(DeviceFault.EMERGENCY_STOP) or plain("")):
        for words in (SPANISH, ENGLISH):
            assert re.findall("`gemelo ([^`]*)`", words.why(reason)) in ([], ["device config"])


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
    (Play(demonstration="wave", share=0.5), "play wave, 50 %", "repetir demostración wave, 50 %"),
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
