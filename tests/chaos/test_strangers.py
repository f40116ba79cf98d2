"""The strangers of both buses say what they are asked for."""

from __future__ import annotations

from pathlib import Path
from random import Random

import zenoh

from gemelo.libraries.runtime.bus.branches import read_under
from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.schemas.topics import TOPICS
from gemelo.tools.chaos.strangers import BusStranger
from tests.runtime.support import RouterProcess, until


def test_noise_of_a_stranger_is_on_every_key_of_the_bus(tmp_path: Path):
    router = RouterProcess(tmp_path)
    stranger = BusStranger(router.port, "rm1", ("top",))
    heard = set[str]()
    with zenoh.open(client_config(router.deployment.router, "rm1")) as listener:
        listener.declare_subscriber("**", lambda sample: heard.add(str(sample.key_expr)))
        keys = {zenoh.KeyExpr(read_under(topic.key)) for topic in TOPICS}
        random = Random(1)

        def is_everywhere() -> bool:
            stranger.noise(random)
            return all(any(key.intersects(zenoh.KeyExpr(each)) for each in heard) for key in keys)

        assert until(is_everywhere), (keys, heard)
    stranger.close()
    router.stop()
