"""The pages that lead through the first hour: every word that they name is on the page, and every step does it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser

import gemelo
from services.panel.words.words import TABLES
from services.stack.stack import Stack
from tests.panel.conftest import SIZE
from tests.panel.person import Person, until
from tests.panel.test_page import is_moving, rests

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {"en": DOCS / "first_hour.md", "es": DOCS / "es" / "primera_hora.md"}
NAMED = re.compile(r"(?<!\*)\*{1,2}([^*\n]+?)\*{1,2}(?!\*)")
SENTENCES = ("The red button and the space bar stop the arm", "El botón rojo y la barra espaciadora paran el brazo")


@pytest.mark.parametrize("language", PAGES)
def test_every_word_that_it_names_is_on_the_page(language: str) -> None:
    named = [each for each in NAMED.findall(PAGES[language].read_text().replace("\n", " ")) if each not in SENTENCES]
    words = TABLES[language].values()
    assert len(named) > 25
    assert [each for each in named if not any(text.startswith(each) for text in words)] == []


@pytest.fixture
def fresh(twin: Stack, chromium: Browser) -> Iterator[Person]:
    """Somebody who has just typed `make up`, and reads Spanish."""
    twin.wait_ready(30.0)
    with Person(chromium, twin.deployment["GEMELO_PANEL_PORT"], "es-ES", SIZE) as person:
        yield person
        person.require_no_errors()


def test_the_first_hour_goes_as_it_is_told(fresh: Person, twin: Stack) -> None:
    with gemelo.connect(timeout=10.0) as arm:
        switches_on(fresh, arm)
        moves(fresh, arm)
        jogs(fresh, arm)
        puts_something_in_the_way(fresh, arm)
        teaches(fresh, arm, Path(twin.deployment["GEMELO_PATHS_PROGRAMS"]))
        breaks_it(fresh, arm)


def switches_on(person: Person, arm: gemelo.Arm) -> None:
    person.reads("En reposo")
    person.tab("Equipo")
    person.press("Apagar los motores")
    until(lambda: not arm.device.state.armed, bool)
    declares(person, arm)


def declares(person: Person, arm: gemelo.Arm) -> None:
    person.press("Encender los motores")
    until(lambda: arm.device.state.armed, bool)
    person.press("Declarar la referencia")
    person.press("Sí, está así")
    person.reads("En reposo")


def moves(person: Person, arm: gemelo.Arm) -> None:
    person.tab("Mover")
    person.types("brazo_joint [°]", 30)
    person.press("Planificar")
    person.reads("Duración")
    assert not is_moving(arm)
    person.press("Ejecutar")
    person.reads("Llegó")
    assert arm.joints["brazo_joint"] == pytest.approx(0.5236, abs=1e-3)
    person.types("brazo_joint [°]", -150)
    person.press("Planificar y ejecutar")
    until(lambda: is_moving(arm), bool)
    person.page.keyboard.press("Space")
    rests(arm)
    person.reads("El movimiento terminó antes de la meta")


def jogs(person: Person, arm: gemelo.Arm) -> None:
    person.tab("A mano")
    before = arm.joints["brazo_joint"]
    person.button("brazo_joint +").hover()
    person.page.mouse.down()
    until(lambda: is_moving(arm), bool)
    person.page.mouse.up()
    rests(arm)
    assert arm.joints["brazo_joint"] > before


def puts_something_in_the_way(person: Person, arm: gemelo.Arm) -> None:
    arm.move(named="home")
    person.tab("Escena")
    person.types("Nombre", "poste")
    for label, numbers in (("Tamaño [mm]", (40, 40, 160)), ("Centro [mm]", (290, 270, 80))):
        for place, number in enumerate(numbers):
            field = person.row(label).locator("input").filter(visible=True).nth(place)
            field.fill(str(number))
            field.press("Enter")
    person.press("Añadir")
    until(lambda: "poste" in arm.scene.objects, bool)
    person.tab("Mover")
    person.chooses("Posición con nombre", "left")
    person.press("Planificar")
    person.reads("Duración")
    person.press("Ejecutar")
    until(lambda: arm.joints["brazo_joint"], lambda at: abs(at - arm.states["left"]["brazo_joint"]) < 1e-3)
    rests(arm)


def teaches(person: Person, arm: gemelo.Arm, folder: Path) -> None:
    person.tab("Enseñar")
    for name in ("Uno", "Dos", "Tres"):
        arm.move(joints={"brazo_joint": arm.joints["brazo_joint"] - 0.1})
        person.types("Nombre", name)
        person.press("Recordar esta posición")
        until(lambda name=name: f'"{name}"' in text_of(folder) or f".{name}]" in text_of(folder), bool)
    person.tab("Programas")
    for name in ("Uno", "Dos", "Tres"):
        person.chooses("Adónde", name)
        person.press("Añadir tras el paso")
        person.reads(f"ir a {name}")
    person.press("Revisar todo el programa")
    person.reads("Todo el programa se puede ejecutar")
    person.press("Ejecutar desde el paso")
    person.reads("Terminado.")


def breaks_it(person: Person, arm: gemelo.Arm) -> None:
    person.tab("Equipo")
    person.page.get_by_text("Lo que podría hacer una mano").filter(visible=True).first.click()
    motion = arm.start(named="home", speed=0.1)
    until(lambda: is_moving(arm), bool)
    person.press("Pulsar la parada de emergencia")
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    person.reads("Parada de emergencia")
    person.press("Soltar la parada de emergencia")
    person.press("Borrar el fallo")
    declares(person, arm)
    before = steps_away(person)
    person.tab("Equipo")
    person.press("Hacer patinar brazo_joint 10 pasos")
    until(lambda: steps_away(person), lambda away: away == before + 10)
    assert arm.step_errors["brazo_joint"] == 0.0


def steps_away(person: Person) -> int:
    """By how many steps the first joint's shaft is not where its counter says."""
    person.tab("Estado")
    rows = person.page.locator("table").filter(has_text="eje real", visible=True).locator("tr")
    _, _, executed, shaft = rows.filter(has_text="brazo_joint").first.locator("td").all_inner_texts()
    return int(shaft) - int(executed)


def text_of(folder: Path) -> str:
    return "\n".join(file.read_text() for file in folder.glob("*.points.toml"))
