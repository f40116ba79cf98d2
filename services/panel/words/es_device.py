"""The device's own words in Spanish: its commands, the codes of its answers, its faults, and a refused goal's codes.

They are told inside other sentences: each table is for the place of a value that is called so.
"""

from __future__ import annotations

from gemelo.schemas.motion import FollowErrorCode

_AGAIN = "`gemelo reset`, `gemelo home`"
_AGAIN_ES = "pulse «Borrar el fallo» y «Buscar el origen»"

_MEANINGS: dict[tuple[str, str], tuple[str, str]] = {  # meaning and remedy, as `gemelo.schemas.device_faults` says them
    (
        "the step pulses waited more than 3 ms for the path",
        f"{_AGAIN}; if it comes again, lower [device] tick_hz in robot.toml",
    ): (
        "los pulsos esperaron el camino más de 3 ms",
        f"{_AGAIN_ES}; si vuelve, baje tick_hz de [device] en robot.toml",
    ),
    (
        "the firmware found something that cannot be",
        "write down what `gemelo device status` says, then restart the device",
    ): ("el firmware encontró algo que no puede ser", "anote lo que dice la pestaña Estado, y reinicie el equipo"),
    (
        "its limit switch was pressed",
        f"see what it ran into (a torn wire looks the same), then {_AGAIN}",
    ): ("se pulsó su final de carrera", f"vea contra qué chocó (un cable roto se ve igual); luego {_AGAIN_ES}"),
    (
        "it took longer than homing.timeout to find its place",
        f"see that it moves freely, or raise homing.timeout or homing.fast in robot.toml, then {_AGAIN}",
    ): (
        "tardó en encontrar su sitio más que homing.timeout",
        f"vea que se mueva libre, o suba homing.timeout u homing.fast en robot.toml; luego {_AGAIN_ES}",
    ),
    (
        "it travelled homing.max_travel and its home switch did not close",
        "press the switch by hand under `gemelo device monitor`; see that homing.direction in robot.toml is right, "
        "then "
        f"{_AGAIN}",
    ): (
        "recorrió homing.max_travel y su interruptor de origen no se cerró",
        "pulse el interruptor con la mano y vea en la pestaña Equipo si cambia; revise homing.direction en robot.toml; "
        f"luego {_AGAIN_ES}",
    ),
    (
        "it moved off its home switch and the switch stays pressed",
        f"free the switch, or look for a torn wire or a wrong `active` in robot.toml, then {_AGAIN}",
    ): (
        "se apartó de su interruptor de origen y este sigue pulsado",
        f"libere el interruptor, o busque un cable roto o un `active` equivocado en robot.toml; luego {_AGAIN_ES}",
    ),
    (
        "the emergency stop is or was pressed; the drivers are off",
        "when the danger is over: release it, `gemelo reset`, `gemelo device arm`, `gemelo home`",
    ): (
        "la parada de emergencia está o estuvo pulsada; los motores están apagados",
        "cuando pase el peligro: suéltela, borre el fallo, encienda los motores y busque el origen",
    ),
    (
        "a fault that only a newer gemelo knows",
        "update gemelo",
    ): ("un fallo que solo conoce una versión más nueva", "actualice este programa"),
}
_AT = {"": "", ' at joint "{joint}"': " en {joint}"}
FAULTS: dict[str, str] = {
    f"{{fault}}{at}: {meaning}; {remedy}": f"{{fault}}{_AT[at]}: {significado}; {remedio}."
    for (meaning, remedy), (significado, remedio) in _MEANINGS.items()
    for at in _AT
}

VALUES: dict[str, dict[str, str]] = {
    "fault": {
        "TICK_OVERRUN": "Pulsos con retraso",
        "INTERNAL": "Fallo interno",
        "LIMIT_SWITCH": "Final de carrera",
        "HOMING_TIMEOUT": "Origen no encontrado a tiempo",
        "SWITCH_NOT_FOUND": "Interruptor no encontrado",
        "SWITCH_STUCK": "Interruptor atascado",
        "EMERGENCY_STOP": "Parada de emergencia",
    },
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
    "code": {
        "OK": "hecho",
        "DUPLICATE": "ya lo tenía",
        "GAP": "falta una parte anterior",
        "NO_SPACE": "su cola está llena",
        "BAD_DT": "el paso de tiempo no vale",
        "POSITION_LIMIT": "más allá de un límite de posición",
        "VELOCITY_LIMIT": "más allá de un límite de velocidad",
        "START_MISMATCH": "no empieza donde está el brazo",
        "WRONG_BOOT": "era para antes de su reinicio",
        "EXPIRED": "llegó tarde",
        "RETAINED": "era un mensaje viejo del broker",
        "BAD_JOINTS": "no son sus articulaciones",
        "NOT_READY": "no está listo",
        "WRONG_STREAM": "era de otro camino",
        "NOT_AT_REST": "no terminaría quieto",
        "UNKNOWN_CMD": "no conoce la orden",
        "BAD_COUNT": "no son los puntos que dice",
        "NOT_ARMED": "los motores están apagados",
        "ESTOP_PRESSED": "la parada de emergencia está pulsada",
        "NO_HOMING": "no hay interruptor de origen",
        "BAD_ARGUMENT": "el valor no vale",
        "ACCELERATION_LIMIT": "más allá de un límite de aceleración",
    },
    "edge": {"radius": "el radio", "length": "la longitud"},
    "side": {"lower": "inferior", "upper": "superior"},
    "status": {
        "canceled": "cancelado",
        "aborted": "antes de la meta",
        "preempted": "por otro",
        "succeeded": "bien",
        "CANCELED": "cancelado",
        "ABORTED": "antes de la meta",
        "PREEMPTED": "por otro",
        "SUCCEEDED": "bien",
        "ready": "listo",
        "running": "en marcha",
        "paused": "en pausa",
        "stopped": "parado",
        "failed": "fallido",
        "done": "terminado",
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
