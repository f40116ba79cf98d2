"""The preconditions of chaos: its stack's state before it starts."""

from pathlib import Path

from services.chaos.site import ChaosSite, processes_of
from services.runtime.deployment import load_deployment
from services.runtime.saved_parameters import SavedParameters
from services.stack.stack import PROCESSES


def test_everything_that_a_stack_may_run_runs_in_chaos_and_less_in_a_soak(tmp_path: Path):
    sites = [
        ChaosSite(tmp_path / str(is_judged), "embedded", seed=1, is_judged=is_judged) for is_judged in (True, False)
    ]
    try:
        assert sites[0].stack.processes == processes_of(load_deployment()) == PROCESSES
        assert set(PROCESSES) - set(sites[1].stack.processes) == {"viewer", "panel", "camera", "detector"}
    finally:
        for site in sites:
            site.stack.stop()


def test_the_logger_keeps_every_recording_of_a_long_run(tmp_path: Path):
    site = ChaosSite(tmp_path, "embedded", seed=1, is_judged=False)
    try:
        assert SavedParameters(site.stack.run, "logger").read() == {"keep_files": 0}
    finally:
        site.stack.stop()
