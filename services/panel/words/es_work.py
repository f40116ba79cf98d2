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

# What stands before a reason
_SILENT: dict[str, str] = {
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
