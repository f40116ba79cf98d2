"""The device's own words in Spanish: its commands and modes, kinds of parts, and a refused goal's codes.

They stand inside other sentences: each table is for the place of a value that is called so.
"""

from __future__ import annotations

from gemelo.schemas.motion import FollowErrorCode

VALUES: dict[str, dict[str, str]] = {
    "what": {
        "there": "está ahí",
        "there (commanded, not measured)": "está ahí (mandada, no medida)",
        "stopped by what is between the jaws": "la detuvo lo que hay entre las mordazas",
        "stopped by what is between the jaws (commanded, not measured)": "la detuvo lo que hay entre las mordazas "
        "(mandada, no medida)",
    },
    "command": {
        "HOLD": "la pausa",
        "RESUME": "continuar",
        "STOP": "la parada",
        "RESET": "borrar el fallo",
        "REFERENCE": "declarar la referencia",
        "ARM": "encender los motores",
        "DISARM": "apagar los motores",
        "HOME": "buscar el origen",
        "OUTPUT": "la salida",
        "SPEED": "la velocidad",
        "STATUS": "la pregunta por su estado",
        "SERVO": "mover la pinza",
    },
    "mode": {
        "BOOT": "arrancando",
        "UNREFERENCED": "sin referencia",
        "HOMING": "buscando el origen",
        "IDLE": "en reposo",
        "RUN": "en movimiento",
        "HOLD": "en pausa",
        "FAULT": "fallo",
        "ESTOP": "parada de emergencia",
    },
    "kind": {
        "box": "la caja",
        "sphere": "la esfera",
        "cylinder": "el cilindro",
        "joint": "articulación",
        "input": "interruptor",
        "sensor": "sensor",
        "output": "salida",
        "point": "punto",
        "program": "programa",
        "state": "posición con nombre",
        "link": "eslabón",
        "thing": "cosa",
        "place": "lugar",
    },
    "phase": {
        "waits": "espera",
        "to its switch": "hacia su interruptor",
        "off its switch": "saliendo de su interruptor",
        "home": "en su origen",
    },
}

# What the code of a refused or aborted goal says, where its sentence is not known.
GOAL_CODES: dict[int, str] = {
    FollowErrorCode.INVALID_GOAL: "El movimiento que se pide no puede ser así: planifique otra vez.",
    FollowErrorCode.INVALID_JOINTS: "El movimiento no nombra las articulaciones de este brazo.",
    FollowErrorCode.OLD_HEADER_TIMESTAMP: "El movimiento es de hace demasiado tiempo: planifique otra vez.",
    FollowErrorCode.PATH_TOLERANCE_VIOLATED: "El brazo se apartó de su camino más de lo permitido: vaya más despacio, "
    "y "
    "vea si algo lo frena.",
    FollowErrorCode.GOAL_TOLERANCE_VIOLATED: "El brazo no llegó bastante cerca de la meta: verifique su referencia.",
    FollowErrorCode.CANCELED: "Alguien lo canceló.",
    FollowErrorCode.PREEMPTED: "Otro movimiento tomó su lugar.",
    FollowErrorCode.DEVICE_FAILED: "El equipo no puede moverse ahora, o falló: vea la pestaña Equipo.",
    FollowErrorCode.SCENE_CHANGED: "La escena cambió desde el plan: planifique otra vez.",
    FollowErrorCode.NOT_IN_CONTROL: "Otra persona tiene el mando del brazo: pídaselo, o tome el mando en esta página.",
}
