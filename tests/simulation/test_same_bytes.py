"""The same seed gives the same bytes: every message of every node, in another simulation and in another process."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.runtime.bus.memory_network import MemoryPublication

ROOT = Path(__file__).parents[2]


class Published:
    """A digest of all that is published, in its order."""

    def __init__(self) -> None:
        self.count, self._digest = 0, hashlib.sha256()

    def take(self, key: str, payload: bytes) -> None:
        self.count += 1
        self._digest.update(key.encode() + b"\0" + payload)

    @property
    def digest(self) -> str:
        return self._digest.hexdigest()


def busy_life(seed: int) -> Published:
    """A twin that is planned for, moved, jogged, stopped and broken, over a wire that loses frames."""
    published, put = Published(), MemoryPublication.put

    def recorded(publication: MemoryPublication, payload: bytes) -> None:
        published.take(publication.key, payload)
        put(publication, payload)

    wire = {"delay": 0.002, "jitter": 0.004, "loss": 0.02}
    with pytest.MonkeyPatch.context() as patch, gemelo.simulate("rm1", seed=seed, wire=wire) as arm:
        patch.setattr(MemoryPublication, "put", recorded)
        arm.move(named="ready")
        arm.scene.add_box("post", (0.05, 0.05, 0.2), at=(0.2, 0.2, 0.1))
        arm.jog(joints={"brazo_joint": 0.1}, duration=0.3)
        with pytest.raises(gemelo.Refused):
            arm.move(position=(0.9, 0.0, 0.1))
        arm.start(named="left")
        arm.sim.sleep(0.4)
        arm.sim.press("estop")
    return published


def test_the_same_seed_gives_the_same_bytes_and_another_others() -> None:
    first, again, other = (busy_life(seed) for seed in (3, 3, 4))
    assert first.count > 1000
    assert (first.count, first.digest) == (again.count, again.digest)
    assert first.digest != other.digest


def test_another_process_gives_the_same_bytes() -> None:
    code = "from tests.simulation.test_same_bytes import busy_life; print(busy_life(3).digest)"
    digests = set()
    for hash_seed in ("1", "2"):
        environ = os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=ROOT, env=environ, capture_output=True, text=True, timeout=120, check=True
        )
        digests.add(done.stdout.strip())
    assert len(digests) == 1
    assert digests == {busy_life(3).digest}
