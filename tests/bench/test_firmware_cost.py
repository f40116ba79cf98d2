"""The figures of the chip, from what firmware/tests/rv32/run prints."""

import json

import pytest

from gemelo.tools.bench import firmware_cost
from gemelo.tools.bench.figures import NotMeasured


@pytest.fixture
def prints(tmp_path, monkeypatch):
    """Puts a script in the place of the real one, that prints this and ends with that."""

    def put(text: str, code: int = 0) -> None:
        script = tmp_path / "run"
        script.write_text(f"#!/bin/sh\ncat <<'END'\n{text}\nEND\necho no compiler >&2\nexit {code}\n")
        script.chmod(0o755)
        monkeypatch.setattr(firmware_cost, "RUN", str(script))

    firmware_cost.cost.cache_clear()
    yield put
    firmware_cost.cost.cache_clear()


def test_a_missing_tool_is_named_with_its_remedy(prints):
    prints(json.dumps({"missing": "qemu-system-riscv32 missing: sudo apt-get install qemu-system-misc"}))
    with pytest.raises(NotMeasured, match="apt-get install qemu-system-misc"):
        firmware_cost.size("core_ram_bytes", 7250.0, "")


def test_a_core_that_does_not_compile_is_said(prints):
    prints("", code=1)
    with pytest.raises(NotMeasured, match="no compiler"):
        firmware_cost.instructions("tick", {})


def test_median_and_tail_are_of_six_joints_and_the_means_stand_beside(prints):
    rows = {"mean": 10.5, "median": 10, "p99": 20, "max": 30}
    figures = {f"tick_{joints}_{row}": value * joints for joints in (3, 6) for row, value in rows.items()}
    prints(json.dumps({"figures": figures, "gates": {"tick_6_mean": 70, "slot_6_mean": 1}}))
    figure = firmware_cost.instructions("tick", {"prototype 6 joints mean": 106.0})
    assert (figure.median, figure.p99) == (60, 120)
    assert figure.reference == {
        "3 joints mean": 31.5, "6 joints mean": 63.0, "3 joints most": 90, "6 joints most": 180,
        "prototype 6 joints mean": 106.0,
    }  # fmt: skip
    assert "tick_6_mean 70" in figure.note
    assert "slot" not in figure.note
