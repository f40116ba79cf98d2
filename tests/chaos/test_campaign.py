"""The order of faults, and the reports of what came of them."""

from __future__ import annotations

import itertools
import json
import shlex
from argparse import ArgumentParser

import msgspec

from gemelo.schemas.deployment import Deployment, Wire
from gemelo.schemas.reasons import because, plain, say
from gemelo.tools.chaos.campaign import Episode, meddled, order, unexpected_hands, words_of
from gemelo.tools.chaos.faults import FAULTS, Fault
from gemelo.tools.chaos.main import chosen_faults, line_of, possible_faults, unfit
from gemelo.tools.chaos.report import ChaosReport, page_of, rows_of, summary, text_of
from gemelo.tools.chaos.site import processes_of
from gemelo.tools.cli.common.language import choose
from gemelo.tools.cli.recording.chaos import add_chaos_options
from gemelo.tools.stack.not_ready import NotReady
from gemelo.tools.stack.stack import PROCESSES, StackError


def fault(name: str) -> Fault:
    (found,) = (each for each in FAULTS if each.name == name)
    return found


def episode(number: int, name: str, *violations: str) -> Episode:
    return Episode(number=number, fault=name, chosen=name, ended="succeeded", to_ready=1.0, violations=violations)


def report(*episodes: Episode) -> ChaosReport:
    return ChaosReport(
        seed=7, robot="rm1", broker="mosquitto", seconds=60.0, episodes=episodes, states_heard=10, states_lost=0
    )


def test_names_are_unique() -> None:
    assert len({each.name for each in FAULTS}) == len(FAULTS)


def test_a_seed_gives_the_same_faults_with_the_same_chance_again() -> None:
    first, second = ([*itertools.islice(order(7), 60)] for _ in range(2))
    assert [(number, each.name, chance.random()) for number, each, chance in first] == [
        (number, each.name, chance.random()) for number, each, chance in second
    ]
    other = [each.name for _, each, _ in itertools.islice(order(8), 60)]
    assert other != [each.name for _, each, _ in first]


def test_one_episode_alone_has_the_chance_that_it_had_in_its_run() -> None:
    whole = [chance.random() for _, _, chance in itertools.islice(order(3), 20)]
    ((number, _, chance),) = itertools.islice(order(3), 13, 14)
    assert (number, chance.random()) == (13, whole[13])


def test_the_command_that_repeats_an_episode_brings_its_fault_again() -> None:
    """Also where only some faults were chosen."""
    only = ("clock", "e-stop", "hold")
    whole = [each.name for _, each, _ in itertools.islice(order(5, chosen_faults(only)), 12)]
    found = msgspec.structs.replace(report(episode(9, whole[9], "it jumped")), seed=5, only=only)
    (line,) = [each for each in text_of(found).splitlines() if "again: " in each]
    parser = ArgumentParser()
    add_chaos_options(parser)
    typed = parser.parse_args(shlex.split(line.partition("gemelo chaos ")[2]))
    ((_, again, _),) = itertools.islice(order(typed.seed, chosen_faults(typed.only)), typed.episode, typed.episode + 1)
    assert again.name == whole[9]


def test_every_fault_comes_once_before_any_comes_twice() -> None:
    names = [each.name for _, each, _ in itertools.islice(order(1), 2 * len(FAULTS))]
    assert sorted(names[: len(FAULTS)]) == sorted(names[len(FAULTS) :]) == sorted(each.name for each in FAULTS)


def test_a_person_may_only_do_what_the_fault_asks_for() -> None:
    assert unexpected_hands(fault("stop"), ["stop"]) == []
    assert unexpected_hands(fault("kill planner"), ["reference"]) == [because("chaos.hand", hand="reference")]
    assert unexpected_hands(fault("kill planner"), ["reference"], was_late=True) == []
    assert unexpected_hands(fault("device reboots"), ["arm", "reference"]) == []
    (reset,) = unexpected_hands(fault("device reboots"), ["reset"])
    assert str(reset) == "a person had to reset"
    assert unexpected_hands(fault("e-stop"), ["reset", "arm", "reference"]) == []


def test_what_takes_no_part_in_a_move_may_not_end_it() -> None:
    for name in ("kill panel", "restart planner", "freeze viewer long", "kill camera", "freeze detector shortly"):
        assert meddled(fault(name), "succeeded", None) == []
        silent = because("ended.aborted", because("device.silent", device="rm1", time=0.5), time=0.5)
        assert meddled(fault(name), "aborted", silent) == []
        (said,) = meddled(fault(name), "canceled", None)
        process = name.split()[1]
        assert said == because("chaos.meddled", because("ended.unexplained"), process=process, ended="canceled")
        assert str(said) == f"{process} takes no part in a move, and yet it ended canceled: no reason was given"
    (said,) = meddled(fault("kill panel"), "aborted", plain("its client has gone"))
    assert str(said).endswith("it ended aborted: its client has gone")
    assert meddled(fault("kill stepper_gateway"), "lost", None) == meddled(fault("stop"), "canceled", None) == []


def test_a_run_is_good_only_if_nothing_was_violated() -> None:
    assert report(episode(0, "stop")).is_good
    assert not report(episode(0, "stop", "it jumped")).is_good
    assert not msgspec.structs.replace(report(episode(0, "stop")), violations=("a recording cannot be read",)).is_good


def test_the_reports_name_each_violation_and_the_command_that_repeats_it() -> None:
    found = report(episode(0, "stop"), episode(1, "stop", "<b>jumped"), episode(2, "hold"))
    assert [(row.fault, row.count, row.violations) for row in rows_of(found.episodes)] == [
        ("hold", 1, 0),
        ("stop", 2, 1),
    ]
    whole = summary(found)
    assert (whole.code, whole.values["count"], whole.values["seed"]) == ("chaos.summary", 3, 7)
    assert [why.code for why in whole.causes] == ["chaos.not_held", "chaos.judged", "chaos.lost"]
    assert str(whole).startswith("3 faults in 60 s (3.0 a minute), seed 7: 1 faults and 0 checks violated; 0 slots")
    assert "again: gemelo chaos --seed 7 --broker mosquitto --episode 1\n" in f"{text_of(found)}\n"
    some = msgspec.structs.replace(found, only=("stop", "clock steps"))
    assert "--seed 7 --only stop 'clock steps' --broker mosquitto --episode 1" in text_of(some)
    page = page_of(found)
    assert "&lt;b&gt;jumped" in page
    assert "<b>jumped" not in page
    assert page.count("<circle") == 3
    assert json.loads(msgspec.json.encode(found))["episodes"][1]["violations"] == ["<b>jumped"]


def test_a_report_says_of_each_process_that_is_not_ready_why_and_what_it_said_last() -> None:
    unready = (NotReady("planner", "it is frozen", ("one", "two")), NotReady("logger", "it does not run", ()))
    assert [
        str(why) for why in words_of(StackError("not ready after 20 s: planner, logger\n--- planner", unready))
    ] == [
        "not ready after 20 s: planner, logger",
        "planner is not ready: it is frozen; its last lines: one | two",
        "logger is not ready: it does not run; it has printed nothing",
    ]


def test_what_cannot_be_run_is_said(monkeypatch) -> None:
    assert unfit(0.0, FAULTS, []) == because("chaos.minutes", minutes=0.0)
    assert str(unfit(float("nan"), FAULTS, [])) == "--minutes nan: it must be above 0"
    assert chosen_faults(["router"])
    none = unfit(1.0, chosen_faults(["nothing", "none"]), ["nothing", "none"])
    assert none == because("chaos.no_fault", words=("nothing", "none"))
    assert say(none, "es").startswith("ninguna falla se llama nothing o none")
    assert unfit(1.0, FAULTS, []) is None
    monkeypatch.setenv("GEMELO_DEVICE", "board")
    assert unfit(1.0, FAULTS, []) == because("chaos.board")


def test_the_line_of_an_episode_has_what_was_done_by_hand_and_what_was_violated() -> None:
    assert str(line_of(episode(3, "stop"))) == "   3 stop: succeeded"
    found = msgspec.structs.replace(episode(12, "stop", "it jumped"), hands=("reset", "arm"), was_late=True)
    line = line_of(found)
    assert str(line) == "  12 stop: succeeded; by hand: reset, arm; the machine was late; VIOLATED: it jumped"
    assert [why.code for why in line.causes] == ["chaos.by_hand", "chaos.late", "chaos.violated"]


def test_a_report_is_in_the_language_that_was_chosen_and_its_data_is_not() -> None:
    late = because("chaos.not_recorded", count=2, first=5)
    jump = because("chaos.jump", joint="brazo_joint", steps=90, time=0.02, allowed=40.0)
    bad = msgspec.structs.replace(episode(1, "stop", str(jump)), hands=("reset",), why=(jump,))
    found = report(episode(0, "stop"), bad)
    found = msgspec.structs.replace(found, violations=(str(late),), why=(late,))
    english, data = (text_of(found), page_of(found)), msgspec.json.encode(found)
    choose("es")
    try:
        text, page = text_of(found), page_of(found)
        assert msgspec.json.encode(found) == data
    finally:
        choose("en")
    assert "2 fallas en 60 s (2.0 por minuto), semilla 7: violaciones en 1 fallas y 1 comprobaciones" in text
    assert "el movimiento" in text.splitlines()[0]
    assert "borrar el fallo" in text.splitlines()[2]
    assert "episodio 1, stop: brazo_joint avanzó +90 pasos en 20.0 ms; se permiten 40" in text
    assert say(line_of(bad), "es").endswith("VIOLACIÓN: brazo_joint avanzó +90 pasos en 20.0 ms; se permiten 40")
    assert "2 estados de las articulaciones no están grabados, el primero en 5" in text
    assert '<html lang="es">' in page
    assert "Violaciones" in page
    assert (text_of(found), page_of(found)) == english
    assert "2 joint states are not recorded, the first at 5" in english[0]


def test_every_process_is_killed_restarted_and_frozen():
    names = {each.name for each in FAULTS}
    for process in PROCESSES:
        wanted = {f"kill {process}", f"restart {process}", f"freeze {process} shortly", f"freeze {process} long"}
        assert wanted - {"restart viewer"} <= names  # one that is asked to end was closed by its user, and stays closed


def test_what_is_done_to_a_process_that_does_not_run_is_left_out():
    here = processes_of(Deployment(robot="urdf/rm1"))
    assert set(here) == set(PROCESSES)  # rm1 has a cell of its own
    assert possible_faults(FAULTS, here) == FAULTS
    blind = processes_of(Deployment(robot="tests/urdf"))
    assert set(PROCESSES) - set(blind) == {"camera", "detector"}
    left_out = {each.name for each in FAULTS} - {each.name for each in possible_faults(FAULTS, blind)}
    assert left_out == {each.name for each in FAULTS if "camera" in each.name or "detector" in each.name}
    assert len(left_out) == 16


def test_every_process_gets_the_signals_of_a_terminal_and_every_one_but_the_device_a_twin():
    names = {each.name for each in FAULTS}
    for process in PROCESSES:
        assert {f"SIGHUP {process}", f"SIGQUIT {process}"} <= names
    assert {name for name in PROCESSES if f"twin {name}" not in names} == {"virtual_esp32"}
    by_port = {"router", "broker", "virtual_esp32", "viewer", "panel"}  # which a frozen one keeps
    assert {name for name in PROCESSES if f"twin of a frozen {name}" not in names} == by_port


def test_only_what_is_done_to_a_serial_line_needs_one():
    on_a_line = {each.name for each in FAULTS if each.wire is Wire.SERIAL}
    assert on_a_line == {each.name for each in FAULTS if "serial line" in each.name}
    assert len(on_a_line) == 4
