"""The preconditions of chaos: its stack's state before it starts."""

from pathlib import Path

from services.chaos.site import Site
from services.runtime.saved_parameters import SavedParameters


def test_the_logger_keeps_every_recording_of_a_long_run(tmp_path: Path):
    site = Site(tmp_path, "amqtt", seed=1, is_judged=False)
    try:
        assert SavedParameters(site.stack.run, "logger").read() == {"keep_files": 0}
    finally:
        site.stack.stop()
