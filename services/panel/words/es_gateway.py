"""Spanish of the sentences about the device that have no code yet.

A key is the sentence as it is sent; `sentences.py` says how it is found.
"""

from __future__ import annotations

GATEWAY: dict[str, str] = {
    'there is no {kind} "{name}"': "No hay {kind} «{name}».",
    "{robot} has no gripper: write a [gripper] into its robot.toml": "{robot} no tiene pinza: escriba un [gripper] en "
    "su robot.toml.",
    "all joints are home": "todas las articulaciones están en su origen.",
}
