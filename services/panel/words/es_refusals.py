"""Spanish of the refusals, by the check that refused, as `sentence_of` looks them up.

A key's end says which form it is: "_axis" where the subject is x, y or z, "_touch" where two things do, "_inside" where
it is known how deep, "_own" where the subject is the request itself, "_unknown" where there is no value.
"""

from __future__ import annotations

REFUSALS: dict[str, str] = {
    # where the arm is or would be
    "joint_limit": "{subject}: {value} está más allá de su límite de {limit}.",
    "start_state": "{subject} está en {value}, más allá de su límite de {limit}: muévala a mano hasta dentro y declare "
    "otra vez la referencia.",
    "moving_start": "{subject} se mueve a {value}, y un plan empieza en reposo: espere, o pulse Parar.",
    "joint_state": "El último estado del brazo tiene {value}, más de {limit}: no se sabe dónde está. Vea si el equipo "
    "está conectado.",
    "joint_state_unknown": "Aún no llegó ningún estado del brazo. Vea si el equipo está conectado.",
    # where the tool can be
    "reach": "Ese punto queda {value} fuera del alcance de la herramienta.",
    "reach_axis": "La herramienta llega en {subject} hasta {limit}, no hasta {value}: faltan {beyond}.",
    "orientation": "La herramienta no puede girarse así: faltan {value}.",
    "orientation_unknown": "La herramienta no puede girarse así.",
    # what would touch
    "collision": "{first} y {second} quedarían a {value}; deben quedar {limit} libres.",
    "collision_inside": "{first} y {second} se tocarían: {value} uno dentro del otro.",
    "collision_touch": "{first} y {second} se tocarían.",
    "collision_unknown": "{first} y {second} quedarían demasiado cerca.",
    "self_collision": "{first} y {second}, del mismo brazo, quedarían a {value}; deben quedar {limit} libres.",
    "self_collision_inside": "{first} y {second}, del mismo brazo, se tocarían: {value} uno dentro del otro.",
    "self_collision_touch": "{first} y {second}, del mismo brazo, se tocarían.",
    "self_collision_unknown": "{first} y {second}, del mismo brazo, quedarían demasiado cerca.",
    "clearance": "{first} y {second} quedan a {value}, demasiado cerca para el planificador nativo: elija el "
    "planificador «RRTConnect», que mira las formas exactas.",
    "clearance_touch": "{first} y {second} se tocan: sepárelos, o elija el planificador «RRTConnect».",
    "clearance_unknown": "{first} y {second} quedan demasiado cerca para el planificador nativo: elija el planificador "
    "«RRTConnect», que mira las formas exactas.",
    "clearance_own": "Se pide que queden {value} libres; lo más cercano que se puede pedir es {limit}.",
    # the search for a path
    "points": "La trayectoria tiene {value} puntos, y se siguen {limit} como mucho: divida el camino "
    "y planifique una parte tras otra.",
    "points_unknown": "La meta no tiene ningún punto: dele uno al menos.",
    "size": "El plan es demasiado grande para enviarlo: divida el camino y planifique una parte tras otra.",
    "size_unknown": "El plan es demasiado grande para enviarlo: divida el camino y planifique una parte tras otra.",
    "allowed_time": "La planificación se detuvo a los {value}; se permitían {limit}: dele más tiempo, o elija una meta "
    "más cercana.",
    "allowed_time_unknown": "No se encontró un camino en el tiempo permitido: dele más tiempo, o elija una meta más "
    "cercana.",
    "planner": "El planificador no pudo responder: planifique otra vez.",
    "cancelled": "El plan fue cancelado.",
    "verification": "El camino que se encontró no pasó su comprobación: vaya a otra velocidad, o elija una meta más "
    "lejana.",
    # how fast
    "scaling": "La velocidad pedida ({subject}) debe ser mayor que 0 y como mucho 1.",
    "pull_out_torque": "El motor de {subject} tendría que dar el {value} de su fuerza: vaya más despacio.",
    "step_rate": "{subject} llegaría al {value} de los pasos por segundo que puede: vaya más despacio.",
    "pulse_width": "{subject} llegaría al {value} de los pulsos por segundo de su controlador: vaya más despacio.",
    "device_queue": "Frenar desde esta velocidad ocupa el {value} de la cola del equipo: vaya más despacio.",
    # lines and arcs
    "singularity": "En esa línea el brazo queda estirado o con dos ejes alineados (singularidad): aléjese de ahí, o "
    "vaya libremente.",
    "jump": "{subject} tendría que saltar {value} en esa línea: aléjese de ahí, o vaya libremente.",
    "configuration": "La herramienta llega así, pero {subject} termina en {value}, no en {limit}: vaya libremente.",
    "arc": "Esos puntos no hacen un arco ({subject}): elija otro punto, o vaya en línea recta.",
    "tool_limit": "{subject} no puede ser {value}: déjelo como estaba.",
    "max_step": "El paso que se pide es demasiado fino: déjelo en 0.",
    # names and requests
    "unknown_planner": "No hay aquí un planificador «{subject}»: elija otro.",
    "unknown_joint": "No hay una articulación «{subject}».",
    "unknown_state": "No hay un estado «{subject}».",
    "unknown_frame": "No hay un marco «{subject}».",
    "unknown_link": "No hay un eslabón «{subject}».",
    "request": "Lo que se pide está incompleto o se contradice («{subject}»).",
    # who may, and how sure
    "control_unknown": "Otra persona tiene el control del brazo: pídaselo, o tome el control en esta página.",
    "confidence": "Solo es seguro al {value} que {subject} no perdió ningún paso, y se pide {limit}: verifíquela.",
    "virtual": "El equipo es real: esto solo se le hace a uno virtual.",
    "moving": "El brazo se mueve: espere a que esté quieto.",
}
