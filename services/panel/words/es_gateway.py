"""Spanish of the sentences about the device and control that have no code yet.

A key is the sentence as it is sent; `sentences.py` says how it is found.
"""

from __future__ import annotations

GATEWAY: dict[str, str] = {
    'there is no {kind} "{name}"': "No hay {kind} «{name}».",
    "{robot} has no gripper: write a [gripper] into its robot.toml": "{robot} no tiene pinza: escriba un [gripper] en "
    "su robot.toml.",
    "{name} was asked for after it: ask again": "Después se pidió {name}: pídalo otra vez.",
    "the device refused the configuration: {reason}": "El equipo rechazó la configuración: {reason}",
    "all joints are home": "todas las articulaciones están en su origen.",
    "refused: this connection does not hold control: nothing to give back": "Esta página no tiene el mando: no hay "
    "nada que devolver.",
    "refused: this connection has lost control of the arm, and {now}: {how} anew": "Esta página perdió el mando del "
    "brazo ({now}): tómelo otra vez.",
}
