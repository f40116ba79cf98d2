"""docs/my_broker.md and its Spanish page: their settings can be loaded, their sentences are those that are said."""

from __future__ import annotations

import re
import ssl
from pathlib import Path

import pytest

from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt.access import BrokerAccess, read_secret, tls_context
from gemelo.libraries.mqtt.failures import NO_TLS, WANTS_CERTIFICATE, denial, failure, refusal, silence
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.schemas.reasons import because, say
from gemelo.services.stepper_gateway.device.session import DeviceSession
from gemelo.services.stepper_gateway.moment import Moment

PAGES = [project_root() / "docs" / name for name in ("my_broker.md", "es/mi_broker.md")]


def blocks(page: Path, kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", page.read_text(), re.S | re.M)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_deployment_of_the_page_can_be_loaded(page, tmp_path):
    files = blocks(page, "toml")
    assert len(files) == 2
    for text in files:
        file = tmp_path / "local.toml"
        file.write_text(text)
        assert load_deployment(file, {}).mqtt.port == 8883


def tls_error(reason: str) -> ssl.SSLError:
    error = ssl.SSLError(1, reason)
    error.reason = reason
    return error


def unbelieved(code: int) -> ssl.SSLCertVerificationError:
    error = ssl.SSLCertVerificationError(1, "certificate verify failed")
    error.verify_code = code
    return error


@pytest.fixture(scope="module")
def said(tmp_path_factory) -> list[str]:
    """What is said of every trouble that the pages name."""
    access = BrokerAccess("h", 1, user="gateway", tls=tls_context(), authority="ca.pem")
    errors = [unbelieved(code) for code in (10, 20, 62)] + [tls_error(NO_TLS[0]), tls_error(WANTS_CERTIFICATE[0])]
    session = DeviceSession("rm1", 3, 1)
    session.on_link(True, "")
    wide = tmp_path_factory.mktemp("wide") / "password"
    wide.touch(mode=0o644)
    with pytest.raises(AccessError) as refused:
        read_secret(str(wide))
    reasons = [
        *(failure(error, access) for error in errors),
        refusal(135, "", access),
        refusal(135, "", BrokerAccess("h", 1)),
        denial("t", access),
        silence(BrokerAccess("h", 1)),
    ]
    return [
        *map(str, reasons),
        str(session.unreachable_reason(Moment(0, 1.0), 0.5)),
        str(refused.value),
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_sentence_of_the_page_is_said(page, said):
    rows = [line.split("|")[1] for line in page.read_text().split("## 3.")[1].splitlines() if line.startswith("| `")]
    sentences = [sentence for row in rows for sentence in re.findall("`(.*?)`", row)]
    assert len(sentences) == len(said)
    for sentence in sentences:
        assert any(sentence in text for text in said), sentence


def test_both_pages_give_the_same_commands_and_settings():
    english, spanish = PAGES
    plain = [[re.sub(" *#.*", "", block) for block in blocks(page, "toml")] for page in (english, spanish)]
    assert plain[0] == plain[1]
    commands = [re.findall(r"`gemelo [^`]*`", page.read_text().replace("\n", " ")) for page in PAGES]
    assert sorted(commands[0]) == sorted(commands[1])


def test_every_trouble_has_a_code_with_the_broker_and_the_user():
    access = BrokerAccess("h", 1, user="gateway", tls=tls_context(), authority="ca.pem")
    open_door = BrokerAccess("h", 1)
    assert [failure(unbelieved(code), access) for code in (10, 9, 20, 62)] == [
        because("broker.tls.expired", broker="h:1"),
        because("broker.tls.not_yet_valid", broker="h:1"),
        because("broker.tls.other_authority", broker="h:1", authority="ca.pem"),
        because("broker.tls.other_name", broker="h:1", host="h"),
    ]
    assert failure(tls_error(NO_TLS[0]), access) == because("broker.tls.none", broker="h:1")
    assert refusal(135, "no", access) == because("broker.user.refused", broker="h:1", user="gateway", words="no")
    assert refusal(5, "no", open_door) == because("broker.user.none", broker="h:1")
    assert denial("t", access, "read") == because(
        "broker.acl.user", broker="h:1", user="gateway", verb="read", topic="t"
    )
    assert silence(open_door) == because("broker.closed.tls", broker="h:1")
    assert say(silence(open_door), "es").startswith("El broker MQTT de h:1 cerró la conexión sin responder")
