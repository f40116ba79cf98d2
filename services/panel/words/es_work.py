"""Spanish of the sentences about the scene, things, jogging, requests, and processes that do not answer.

A key is the sentence as `gemelo` or the planner say it; `sentences.py` says how it is found.
"""

from __future__ import annotations

# Things, cameras and picking
_THINGS: dict[str, str] = {
    "{word} is not seen by {cameras}, and nothing else: is it in the image, lit, and not behind the arm? `gemelo "
    "camera "
    "view`": "{cameras} no ve {word}, ni nada más: ¿está en la imagen, con luz, y no detrás del brazo?",
    "{word} is not seen by {cameras}, which see {others}: is it in the image, lit, and not behind the arm? `gemelo "
    "camera "
    "view`": "{cameras} no ve {word}; ve {others}: ¿está en la imagen, con luz, y no detrás del brazo?",
    "{word}: {reason}": "{word}: {reason}",
    'camera "{camera}": {reason}': "Cámara «{camera}»: {reason}",
    'no image of camera "{camera}" within {time} s: `gemelo camera list`': "Ninguna imagen de la cámara «{camera}» en "
    "{time} s.",
    "it is not known where the camera {camera} stands: measure it, and write it into camera.toml": "no se sabe dónde "
    "está "
    "la cámara {camera}: mídala, y escríbalo en camera.toml.",
    "its tag may be tilted one way or the other ({ratio} of 1): look at it from aside": "no se sabe hacia qué lado se "
    "inclina su etiqueta ({ratio} de 1): mírela de lado.",
    "it is known to +-{error} mm only (limit {limit}): bring the camera nearer": "solo se sabe a +-{error} mm (límite "
    "{limit}): acerque la cámara.",
    "it is seen {count} times: take the others away, or give each a tag of its own": "se ve {count} veces: quite las "
    "otras, o dé a cada una su etiqueta.",
    "the arm moves: images of it are blurred; wait until it stands": "El brazo se mueve y las imágenes salen movidas: "
    "espere a que esté quieto.",
    'every image of camera "{camera}" is {time} s old when it comes (at most {limit}): what lags there, the camera, '
    "the network, or a `detector` with too much to do?": "Cada imagen de la cámara «{camera}» llega con {time} s (a lo "
    "sumo {limit}): ¿qué se retrasa, la cámara, la red o un `detector` con demasiado trabajo?",
    "nothing received of the detector for {time} s: is the process `detector` running?": "El detector calla desde hace "
    "{time} s: ¿está en marcha?",
    "{name} ({kind}): {x} {y} {z} mm, +-{error} mm by {camera}": "{name}: {x} {y} {z} mm, +-{error} mm por {camera}",
    "{name} ({kind}): {x} {y} {z} mm, +-{error} mm by {camera}: {reason}": "{name}: {x} {y} {z} mm, +-{error} mm por "
    "{camera}: {reason}",
    "{to}: {x} {y} {z} mm": "{to}: {x} {y} {z} mm",
    "above it": "encima",
    "carrying it": "llevándola",
    "gripper: {value}, {what}": "pinza: {value}, {what}",
    "gripper: {value}, {what}, holds {name}": "pinza: {value}, {what}, lleva {name}",
    "gripper: {value}, {what}, has let go of {name}": "pinza: {value}, {what}, soltó {name}",
    "{name} is at {place}: seen +-{error} mm, {time} s": "{name} está en {place}: vista a +-{error} mm, {time} s",
    "{name} is at {place}: seen +-{error} mm, at attempt {count}, {time} s": "{name} está en {place}: vista a "
    "+-{error} "
    "mm, al intento {count}, {time} s",
    "{name} is at {place}: seen +-{error} mm, turned {angle} deg by the jaws, {time} s": "{name} está en {place}: "
    "vista a "
    "+-{error} mm, girada {angle}° por las mordazas, {time} s",
    "{name} is at {place}: seen +-{error} mm, turned {angle} deg by the jaws, at attempt {count}, {time} s": "{name} "
    "está "
    "en {place}: vista a +-{error} mm, girada {angle}° por las mordazas, al intento {count}, {time} s",
    "{what}; not seen afterwards: {reason}": "{what}; después no se vio: {reason}",
    "the jaws have closed on nothing": "las mordazas se cerraron sobre nada.",
}

# Jogging, planning and what is asked for
_ASKED: dict[str, str] = {
    "refused: it is {sure} sure that no step is lost, {wanted} are required: {why}": "Solo es seguro al {sure} que no "
    "se "
    "perdió ningún paso, y se pide {wanted}: verifique el brazo.",
}

# Who does not answer
_SILENT: dict[str, str] = {
    "{server} did not answer {key} within {time} s: is it busy, or gone?": "{server} no respondió en {time} s: está "
    "ocupado, o ya no está.",
    "{server} did not answer {key}: it has just ended (`gemelo node list`), or dropped it unread: it takes {most} of "
    "one client, and nothing of one that asks for more; ask again after {pause}": "{server} no respondió: acaba de "
    "terminar, o se le pide demasiado a la vez. Pruebe en {pause}.",
    "{server} did not answer {key} within {timeout} s, sent {tries} times: nobody serves it now (`gemelo node list`), "
    "and whether it was carried out is not known": "{server} no respondió en {timeout} s, y ya no está. No se sabe si "
    "lo hizo.",
    "{asked}: it is alive, and carries out what arrives, but answers {most} of that kind of one client; ask again "
    "after {pause}": "{asked}: sigue en marcha y hace lo que le llega, pero solo responde {most} de ese tipo a cada "
    "cliente; pregunte de nuevo pasados {pause}.",
    "{asked}: nobody serves it now (`gemelo node list`), and whether it was carried out is not known": "{asked}: ya no "
    "está, y no se sabe si lo hizo.",
    '{key}: {most}, all of clients with the certificate "{principal}"': "{key}: {most}, todas de clientes con el "
    "certificado «{principal}».",
    "{server} did not answer {key} within {timeout} s, sent {tries} times: it is alive, and carries out what arrives, "
    "but answers {most} of that kind of one client; ask again after {pause}": "{server} hace lo que le llega, pero se "
    "le pide demasiado a la vez y no respondió. Pruebe en {pause}.",
    "{key}: the router is away; start it with `make up`": "Falta el router: arranque todo con `make up`.",
    "nobody serves {key}: is {server} running? `gemelo node list` shows who is": "Nadie responde: ¿está en marcha "
    "{server}?",
    "nobody serves {key} to {certificate}: is {server} running, and may this role ask it? schemas/roles.py says who "
    "may": ("Nadie responde: ¿está en marcha {server}, y puede pedírselo esta página?"),
    "the answer of {server} to {key} cannot be read: {error}": "La respuesta de {server} no se puede leer ({error}).",
    "{key}: {size} bytes, and {whose} are waiting already: at most {most}; ask again after their answers": "Esperan "
    "demasiados datos a la vez, más de {most} bytes: pruebe de nuevo en un momento.",
    "{key}: {count} requests are waiting already": "Se piden demasiadas cosas a la vez: espere un momento.",
    "{key}: {count} requests are waiting already, all of this client": "Se piden demasiadas cosas a la vez: espere un "
    "momento.",
    "refused by {server}: {reason}": "{reason}",
    "refused: {reason}": "{reason}",
    "stop refused: {reason}": "No se pudo parar: {reason}",
    "{command} refused: {reason}": "{reason}",
    "{command} refused: {reason} (device mode {mode})": "{reason} (modo «{mode}»)",
    "{what} control refused: {reason}": "{reason}",
}

# What may follow any sentence
_HINTS: dict[str, str] = {
    '{reason}; did you mean "{near}"?': "{reason} ¿Quiso decir «{near}»?",
    "{reason}; known are {names}": "{reason} Hay: {names}.",
    "{reason}; none is known": "{reason} No hay ninguno.",
}

# Files and values that arguments of the API give
_ARGUMENTS: dict[str, str] = {
    '{robot} has no joint "{name}"': "{robot} no tiene una articulación «{name}».",
    '{robot} has no link "{name}"': "{robot} no tiene un eslabón «{name}».",
    '{robot} has no {kind} "{name}"': "{robot} no tiene {kind} «{name}».",
    "say how the tool is turned once, not by {names}": "Diga una sola vez cómo se gira la herramienta, no con {names}.",
    "{name} is {value}: it must be finite": "{name} es {value}: debe ser un número.",
    'joint "{joint}" is {value}: it must be finite': "{joint} es {value}: debe ser un número.",
    "{path} cannot be written: it is there already, and is no file": "{path} no se puede escribir: ya existe, y no es "
    "un archivo.",
    "{path} cannot be written: {error}": "{path} no se puede escribir ({error}).",
    "{path} cannot be read: {error}": "{path} no se puede leer ({error}).",
    "{reason}; {more}": "{reason} {more}",
}

WORK: dict[str, str] = _ARGUMENTS | _THINGS | _ASKED | _SILENT | _HINTS
