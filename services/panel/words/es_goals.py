"""Spanish of the gateway's refusals of goals and streamed targets, and of motions that ended before their goal.

A key is the sentence as the gateway says it; `sentences.py` says how it is found.
"""

from __future__ import annotations

# Goals and streamed targets
_LIMIT = "{joint}: {value} {unit} está más allá del límite {side} de {limit} {unit}; quédese entre {lower} y {upper}"
_BEYOND = (
    'joint "{joint}": {value} {unit} is beyond the {side} limit {limit} {unit}; stay within {lower} to {upper} {unit}'
)
_GOALS: dict[str, str] = {
    _BEYOND: _LIMIT + " {unit}.",
    _BEYOND + " at point {point} ({time} s)": _LIMIT + " {unit} (punto {point}, a los {time} s).",
    _BEYOND + " (between points, at {time} s)": _LIMIT + " {unit} (entre dos puntos, a los {time} s).",
    'joint "{joint}": {rate} steps/s at {time} s is more than the {limit} steps/s that its driver and the device can '
    "do; "
    "make the trajectory {factor} times as long": "{joint}: {rate} pasos/s a los {time} s son más que los {limit} "
    "pasos/s que pueden su controlador y el equipo: vaya {factor} veces más despacio.",
    'joint "{joint}": {value} at {time} s is beyond the velocity limit {limit}; make the trajectory {factor} times as '
    "long": "{joint}: {value} a los {time} s está más allá de su límite de velocidad, {limit}: vaya {factor} veces más "
    "despacio.",
    'joint "{joint}": {value} at {time} s is beyond the acceleration limit {limit}; make the trajectory {factor} times '
    "as long, give velocities with the points, or let the planner time it": "{joint}: {value} a los {time} s está más "
    "allá de su límite de aceleración, {limit}: vaya más despacio ({factor} veces), o planifique otra vez.",
    'joint "{joint}": the trajectory starts at {start}, the arm is at {present}: {distance} apart, more than the '
    "{tolerance} allowed; plan from the present state": "{joint}: el plan empieza en {start} y el brazo está en "
    "{present}, a {distance}; se permiten {tolerance}: planifique otra vez desde aquí.",
    "the trajectory ended {time} s ago by its stamp; use stamp 0 to start now, or count from the stamp of the newest "
    "joint_states: the time is that of stepper_gateway's host": "El plan terminó hace {time} s según su hora: "
    "planifique otra vez.",
    "the trajectory's stamp lies {time} s ahead, more than {limit} s; send it later": "El plan empieza dentro de "
    "{time} "
    "s, más de {limit} s: envíelo más tarde.",
    "no way from the arm's present motion onto the trajectory stays within the joint limits": "Desde como el brazo se "
    "mueve ahora no se llega al plan dentro de sus límites: espere a que esté quieto.",
    "no way from the arm's present motion to the point stays within the limits": "Desde como el brazo se mueve ahora "
    "no "
    "se llega al punto dentro de sus límites: espere a que esté quieto.",
    "the point cannot be reached within {time} s: the limits need {least} s; give a later time_from_start": "No se "
    "llega a ese punto en {time} s: los límites piden {least} s.",
    "the way from the arm's present motion to the point leaves the joint limits": "El camino desde como el brazo se "
    "mueve ahora sale de los límites: espere a que esté quieto.",
    "the arm is still decelerating after the last goal; send this one again when it rests": "El brazo aún frena tras "
    "el "
    "movimiento anterior: pruebe otra vez cuando esté quieto.",
    "planned in version {version} of a scene that the planner holds no more; another one is at version {newest} now: "
    "plan again": "El plan se hizo en la versión {version} de una escena que ya no hay (ahora la {newest} de otra): "
    "planifique otra vez.",
    "planned in scene version {version}, the scene is version {newest} now: plan again": "El plan se hizo en la "
    "versión "
    "{version} de la escena y ahora es la {newest}: planifique otra vez.",
    "joint {joints} is missing; a trajectory moves all of {names}": "Falta {joints}: un plan mueve todas ({names}).",
    'joint "{joint}" is unknown': "No hay una articulación «{joint}».",
    'joint "{joint}" is named {count} times; name each joint once': "«{joint}» se nombra {count} veces: nómbrela una.",
    "goal_time_tolerance is {value} s; give a time, 0 for the default or -1 for no bound": "La tolerancia de tiempo no "
    "puede ser {value} s.",
    '{field} is for joint "{joint}", which is unknown': "La tolerancia {field} es para «{joint}», que no existe.",
    '{field} of joint "{joint}": an acceleration of {value} cannot be watched, because the device measures steps and '
    "velocities only; give 0 or -1, and bound the velocity": "{field} de «{joint}»: una aceleración de {value} no se "
    "puede vigilar, pues el equipo solo mide pasos y velocidades.",
    '{field} of joint "{joint}": {quantity} {value} is negative; give a bound, 0 for the default or -1 for no bound': (
        "{field} de «{joint}»: {quantity} {value} es negativo."
    ),
    "the trajectory has no points": "El plan no tiene puntos.",
    "the trajectory has {count} points, more than {limit}; send it in parts": "El plan tiene {count} puntos, más de "
    "{limit}: hágalo por partes.",
    "the points have accelerations but no velocities; give both, or positions only": "Los puntos tienen aceleraciones "
    "y "
    "no velocidades.",
    "point {point} has {count} {field}; {more}": "El punto {point} tiene {count} {field}; {more}",
    "{count} are needed, one per joint": "hacen falta {count}, uno por articulación.",
    "point 0 has none, so no point may": "el primero no tiene, así que ninguno puede.",
    "point {point} has time_from_start {value} s; it must not be negative": "El punto {point} tiene el tiempo {value} "
    "s, que no puede ser negativo.",
    "time_from_start does not increase: {before} s at point {first}, {after} s at point {second}": "El tiempo no "
    "avanza: {before} s en el punto {first}, {after} s en el {second}.",
    "the trajectory takes {time} s, more than {limit} s; send it in parts": "El plan dura {time} s, más de {limit} s: "
    "hágalo por partes, o más rápido.",
    'joint "{joint}" has {value} at the last point; a trajectory must end at rest, with velocity 0': "{joint} lleva "
    "{value} en el último punto: un plan debe terminar quieto.",
    "a goal that follows goal {goal} begins at its end: leave the stamp 0": "Un movimiento que sigue a otro empieza a "
    "su "
    "final: deje su hora en 0.",
    "goal {goal} cannot be followed, it ended {status}: plan from where the arm is": "El movimiento anterior terminó "
    "({status}): planifique desde donde está el brazo.",
    "goal {goal} cannot be followed, it is not under way: plan from where the arm is": "El movimiento anterior ya no "
    "está en marcha: planifique desde donde está el brazo.",
    "goal {goal} follows goal {before} already: send this one when that one has begun": "Ya hay un movimiento que "
    "sigue "
    "al presente: espere a que empiece.",
    "goal {goal} is not being carried out": "Ese movimiento no está en marcha.",
    "a goal is being carried out; cancel it first": "El brazo va hacia una meta: pulse antes Parar.",
    "a goal is being carried out: cancel it first": "El brazo va hacia una meta: pulse antes Parar.",
    "a target names no joint": "Lo que se pide seguir no nombra ninguna articulación.",
    "a target names {named} joints and gives {given} positions": "Se nombran {named} articulaciones y se dan {given} "
    "posiciones.",
    "streaming was interrupted, and nothing resumes by itself: send no target for {time} s, then start again": "El "
    "seguimiento se interrumpió y nada sigue solo: suelte {time} s, y empiece otra vez.",
    "{reason} (and {count} more)": "{reason} (y {count} más)",
}

# How a motion ended before its goal
_ENDS: dict[str, str] = {
    "canceled after {time} s: {reason}": "Cancelado tras {time} s: {reason}",
    "aborted after {time} s: {reason}": "Terminó antes de la meta, tras {time} s: {reason}",
    "preempted after {time} s: {reason}": "Otro movimiento tomó su lugar tras {time} s: {reason}",
    "the arm decelerated on its path": "el brazo frenó sobre su camino.",
    "a newer goal took over": "empezó otro movimiento.",
    "a newer goal took over before this one began": "empezó otro movimiento antes que este.",
    "goal {goal}, which it was to follow, {status}: {reason}": "el movimiento al que seguía terminó antes ({status}): "
    "{reason}",
    "{reason}; then {more}": "{reason} Luego: {more}",
    "{reason}; sent, not verified: the board does not say what it has executed": "{reason} Enviado, sin verificar: la "
    "placa no dice lo que ha ejecutado.",
    "sent, not verified: the board does not say what it has executed": "enviado, sin verificar: la placa no dice lo "
    "que "
    "ha ejecutado.",
    "the device holds by itself and has not said why: see its own log": "el equipo se detuvo solo y no dijo por qué: "
    "vea su registro.",
    "the device holds because it lost the gateway's heartbeat": "el equipo se detuvo porque dejó de oír a "
    "stepper_gateway.",
    "the device holds because somebody else has sent it HOLD or STOP: this gateway has not": "el equipo se detuvo "
    "porque otro le envió una pausa o una parada.",
    "the device holds because it is being shut down": "el equipo se detuvo porque se está apagando.",
    "the device moved along another stream": "el equipo se movió por otro camino.",
    "the device moves along stream {stream}, which nobody follows": "el equipo se mueve por un camino ({stream}) que "
    "nadie sigue.",
    'joint "{joint}" is {error} steps ({value}) from its goal {time} s after acceptance, when it should have been '
    "within "
    "{bound} steps: the device played the path {played} s far": "{joint} está a {error} pasos ({value}) de su meta a "
    "los {time} s; debía estar a menos de {bound} pasos (el equipo recorrió {played} s del camino).",
    'joint "{joint}" is {error} steps off its path at {time} s, more than {bound} steps': "{joint} se apartó {error} "
    "pasos de su camino a los {time} s; se permiten {bound}.",
    'joint "{joint}" is {error} off its velocity at {time} s, more than {bound}': "{joint} se apartó {error} de su "
    "velocidad a los {time} s; se permiten {bound}.",
    'joint "{joint}" was {error} steps off its path as it passed the goal, more than {bound} steps': "{joint} pasó por "
    "la meta a {error} pasos de su camino; se permiten {bound}.",
    'the device refuses chunk {chunk}, knot {knot} ({code}): joint "{joint}" {value}, limit {limit}': "El equipo "
    "rechaza una parte del camino ({code}): {joint}, {value}; su límite es {limit}.",
    "the device refuses chunk {chunk} ({code}: {value}, limit {limit})": "El equipo rechaza una parte del camino "
    "({code}: {value}, límite {limit}).",
    "slowed to rest: {reason}": "frenó: {reason}",
    "{server} has been restarted and does not know the goal any more": "{server} se reinició y ya no conoce el "
    "movimiento.",
    "goal {goal} of {key}: {reason}; what became of it is not known": "No se sabe qué fue del movimiento: {reason}",
    "the router has been away for {time} s": "el router falta desde hace {time} s.",
    "{server} has been silent for {time} s": "{server} calla desde hace {time} s.",
    "all goals were cancelled after it was sent: send it again": "Todo se canceló después de enviarlo: pídalo otra "
    "vez.",
    "it was cancelled before it was looked at": "Se canceló antes de empezar.",
    "no goal is active": "No hay ningún movimiento en marcha.",
    "the server failed": "el programa que lo llevaba falló.",
    "{server} failed: {error}": "{server} falló ({error}).",
    "the motion has no result: it is under way, or the gateway was lost; see status, and wait()": "El movimiento aún "
    "no "
    "tiene resultado.",
}

GOALS: dict[str, str] = _GOALS | _ENDS
