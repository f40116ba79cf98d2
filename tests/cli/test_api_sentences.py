"""Errors of `gemelo`, printed by the command line with its commands in its language."""

from __future__ import annotations

import re

import polib
import pytest

import gemelo
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.reasons.catalogue import LANGUAGES, languages
from gemelo.tools.cli.common import language
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.motion.home import home

METHOD = re.compile(r"\b(arm\.[a-z_.]+\(|gemelo\.(mm|deg|connect)\()")


@pytest.mark.parametrize("code", languages())
def test_only_a_script_reads_of_methods(code: str) -> None:
    entries = [each for file in sorted((LANGUAGES / code).glob("*.po")) for each in polib.pofile(str(file))]
    assert [each.msgid for each in entries if each.msgctxt != "script" and METHOD.search(each.msgstr)] == []


def test_a_joint_without_a_switch_is_refused_with_how_it_is_declared(connected, arm, monkeypatch) -> None:
    monkeypatch.setattr(type(arm.joints[0].drive), "homing", None, raising=False)
    with pytest.raises(CommandError) as error:
        home(connected, ["efector_joint"])
    assert str(error.value).endswith("declare where it stands, `gemelo reference --joints efector_joint=...`")
    assert error.value.code is ExitCode.FAILED
    with pytest.raises(gemelo.Refused) as refused:
        connected.home("efector_joint")
    assert str(refused.value).endswith('declare where it stands, arm.reference({"efector_joint": ...})')
    hint = remedy("declare_joint", joint="efector_joint")
    assert refused.value.reason == because("homing.no_switch", hint, joint="efector_joint")


def test_an_error_of_any_kind_is_printed_with_commands_in_the_language_of_the_command_line() -> None:
    drivers_off = because("homing.drivers_off", remedy("arm_then_home"))
    with pytest.raises(CommandError) as refused, reported(load_robot()):
        raise gemelo.Refused(drivers_off)
    assert str(refused.value) == "homing refused: the drivers are off: `gemelo device arm`, then `gemelo home`"
    assert refused.value.code is ExitCode.FAILED
    language.choose("es")
    with pytest.raises(CommandError) as spanish, reported(load_robot()):
        raise gemelo.Refused(drivers_off)
    assert str(spanish.value).endswith("los motores están apagados: `gemelo device arm`, después `gemelo home`")
    with pytest.raises(CommandError) as wrong, reported(load_robot()):
        raise gemelo.BadArgument("a joint is named twice")
    assert wrong.value.code is ExitCode.USAGE
    with pytest.raises(CommandError) as stopped, reported(load_robot()):
        raise gemelo.Interrupted(because("client.gripper.interrupted"))
    assert stopped.value.code is ExitCode.CANCELLED
    assert str(stopped.value) == "Detenido con Ctrl-C: la pinza queda donde está"
