"""chaos and soak take the broker that is there, and soak says how far it is."""

import pytest

from gemelo.services.broker import mosquitto
from gemelo.tools.chaos.site import installed_broker
from gemelo.tools.chaos.soak import ProcessSample, progress


@pytest.mark.parametrize(("is_installed", "broker"), [(True, "mosquitto"), (False, "embedded")])
def test_the_broker_is_mosquitto_where_it_is_installed(
    is_installed: bool, broker: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mosquitto.shutil, "which", lambda *_, **__: "/bin/mosquitto" if is_installed else None)
    assert installed_broker() == broker


def test_a_soak_says_how_far_it_is() -> None:
    sample = ProcessSample(at=300.0, memory=80.0, resident=90.0, cpu=1.0, files=3, sockets=1, threads=4)
    line = progress(301.0, 3600.0, 120, 1, {"planner": [sample], "logger": [sample, sample]})
    assert str(line) == "5 of 60 min: 120 moves, 1 failed, 160 MB in all"
