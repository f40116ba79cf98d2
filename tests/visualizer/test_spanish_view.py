"""The view in Spanish: titles, curves, the labels of the modes, the device's panel and the log's own words."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from gemelo.schemas.device import DeviceFault, DeviceMode, DeviceState, DeviceStatus, ShaftPositions
from gemelo.schemas.joints import StepErrors
from gemelo.schemas.reasons import because
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.updates import LogLines, TextPanel
from gemelo.services.visualizer.core import Visualizer
from gemelo.services.visualizer.main import view_language
from gemelo.services.visualizer.model.visual_model import VisualModel
from gemelo.services.visualizer.render.arms_layout import arms_blueprint
from gemelo.services.visualizer.render.layout import ArmLayout, OpeningMoment, blueprint
from gemelo.services.visualizer.render.sink import Sink
from tests.visualizer.conftest import START
from tests.visualizer.listener import Listener, views

ENGLISH_WORDS = ("measured", "error of", "step error", "Device", "Log", "joint", "What", "Camera", "mode of")


@pytest.fixture
def core(model: VisualModel) -> Visualizer:
    return Visualizer(model, "rm1", "efector_link", language="es")


def panel_of(core: Visualizer, now: int = START) -> str:
    return next(update.markdown for update in core.step(now) if isinstance(update, TextPanel))


def test_no_title_is_english(model: VisualModel) -> None:
    arm = ArmLayout(model, 20.0, 20.0, ("arriba",), "rm1", "es")
    layouts = (blueprint(arm, OpeningMoment(START, "")), arms_blueprint((arm, arm)))
    names = [str(view.name) for layout in layouts for view in views(layout.root_container)]
    assert (
        "Gemelo: medido (sólido), pedido (azul), brazo y recorrido planificados (cian), lo que choca (rojo) [m]"
        in names
    )
    assert "rm1 · errores de pasos de todas las articulaciones [pasos]" in names
    assert "Qué pasó" in names
    assert [name for name in names if any(word in name.replace("joint", "", 1) for word in ENGLISH_WORDS)] == []


def test_curves_and_modes_have_spanish_labels(model: VisualModel, tmp_path: Path) -> None:
    listener = Listener()
    Sink(listener, model, tmp_path, blueprint(ArmLayout(model, 20.0, 20.0, language="es")), language="es")
    [error] = listener.said[entities.error("brazo_joint")]
    assert error.names.as_arrow_array().to_pylist() == ["pedido - ejecutado", "+0.5 pasos", "-0.5 pasos"]
    [modes] = listener.said[entities.MODE]
    labels = dict(
        zip(modes.values.as_arrow_array().to_pylist(), modes.labels.as_arrow_array().to_pylist(), strict=True)
    )
    assert labels["ESTOP"] == "EN PARADA DE EMERGENCIA"
    assert labels["OFFLINE"] == "FUERA DE LÍNEA"


def test_the_panel_says_why_the_device_is_offline(core: Visualizer) -> None:
    why = because("device.unexplained")
    core.on_device_status(DeviceStatus(stamp=START, online=False, reason=str(why), why=why))
    assert panel_of(core) == "## rm1 · FUERA DE LÍNEA\n\nno se sabe por qué\n"


def test_the_panel_has_the_fault_its_joint_and_the_remedy(core: Visualizer) -> None:
    fault = int(DeviceFault.LIMIT_SWITCH)
    state = DeviceState(
        stamp=START, mode=DeviceMode.FAULT, fault=fault, fault_joint="brazo_joint", name=("brazo_joint",),
        referenced=(False,), speed=0.5, inputs=("estop",), time_scale=1.0,
    )  # fmt: skip
    core.on_device_state(state)
    core.on_step_errors(StepErrors(stamp=START, name=("brazo_joint",), commanded=(1.0,), executed=(1,), error=(0.0,),
                                   max_error=(0.1,)))  # fmt: skip
    text = panel_of(core)
    assert text.startswith("# rm1 · FINAL DE CARRERA EN BRAZO_JOINT\n\n**")
    assert "**MOTORES APAGADOS** · **SIN REFERENCIA** · **velocidad al 50 %** · **pulsado: estop**" in text
    assert "| articulación | posición | pasos pedidos | ejecutados | error | el peor |" in text
    assert "trayectoria al 100 % de su velocidad · 0 ms en cola" in text


def test_lost_steps_are_said_in_the_panel_and_in_the_log(core: Visualizer) -> None:
    core.on_device_state(DeviceState(stamp=START, mode=DeviceMode.IDLE))
    core.on_shaft(ShaftPositions(stamp=START, name=("brazo_joint",), steps=(100,), shaft=(60,)))
    updates = core.step(START)
    panel = next(update.markdown for update in updates if isinstance(update, TextPanel))
    assert "**PASOS PERDIDOS: eje real menos contador: brazo_joint -40** · `gemelo home brazo_joint`" in panel
    [lines] = [update for update in updates if isinstance(update, LogLines)]
    assert lines.texts[0].endswith("brazo_joint: su eje está a -40 pasos de su contador")


def test_the_language_is_the_deployments_else_the_locales(caplog: pytest.LogCaptureFixture) -> None:
    log = logging.getLogger("view")
    assert view_language("es", {"LANG": "en_US.UTF-8"}, log) == "es"
    assert view_language("", {"LANG": "es_AR.UTF-8"}, log) == "es"
    assert view_language("", {}, log) == "en"
    with caplog.at_level(logging.WARNING):
        assert view_language("kl", {"LANG": "es_AR.UTF-8"}, log) == "en"
    assert "[viewer] language is 'kl': the view is in English; there are en, es" in caplog.text
