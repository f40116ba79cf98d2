"""Spanish of the sentences about taught points and programs.

A key is the sentence as `gemelo` or the page's model say it; `sentences.py` says how it is found.
"""

from __future__ import annotations

PROGRAMS: dict[str, str] = {
    'there is a point "{name}": overwrite it, or take another name': "Ya hay un punto «{name}»: reemplácelo, o elija "
    "otro nombre.",
    'there is a point "{name}": remove it first, or take another name': "Ya hay un punto «{name}»: quítelo antes, o "
    "elija otro nombre.",
    'no point "{name}" of {robot}': "{robot} no tiene un punto «{name}».",
    'no point "{name}"': "No hay un punto «{name}».",
    'there is a program "{name}": open it, or take another name': "Ya hay un programa «{name}»: ábralo, o elija otro "
    "nombre.",
    'there is a program "{name}": remove it first, or take another name': "Ya hay un programa «{name}»: bórrelo antes, "
    "o elija otro nombre.",
    'no program "{name}" in {folder}': "No hay un programa «{name}» en {folder}.",
    'no program "{name}"': "No hay un programa «{name}».",
    "no program runs": "Ningún programa está en marcha.",
    'program "{name}" runs already': "El programa «{name}» ya está en marcha.",
    'program "{name}" runs: stop it before it is changed': "El programa «{name}» está en marcha: párelo antes de "
    "cambiarlo.",
    'program "{name}" is {status}: stop it before it starts again': "El programa «{name}» está {status}: párelo antes "
    "de empezarlo otra vez.",
    'program "{name}" is {status}, not {wanted}': "El programa «{name}» está {status}.",
    'program "{name}" has no step {step}': "El programa «{name}» no tiene un paso {step}.",
    'program "{name}" has no step {step}: it has {count}': "El programa «{name}» no tiene un paso {step}: tiene "
    "{count}.",
    'program "{name}" has no step {step}: there is none': "El programa «{name}» no tiene un paso {step}: no tiene "
    "ninguno.",
    'program "{name}" has no step {step}: it has {count} in step {outer}': "El programa «{name}» no tiene un paso "
    "{step}: el {outer} tiene {count}.",
    'program "{name}" has no step {step}: there is none in step {outer}': "El programa «{name}» no tiene un paso "
    "{step}: en el {outer} no hay ninguno.",
    "step {step}: {reason}": "Paso {step}: {reason}",
    "stopped in step {step}": "Parado en el paso {step}.",
    "held on its path": "En pausa sobre su trayectoria.",
    "paused before this step": "En pausa antes de este paso.",
    "{file}, line {line}: step {step}: {reason}": "{file}, línea {line}, paso {step}: {reason}",
    "{file}, line {line}: {reason}": "{file}, línea {line}: {reason}",
    "{file}: step {step}: {reason}": "{file}, paso {step}: {reason}",
    'program "{name}": step {step}: {reason}': "Programa «{name}», paso {step}: {reason}",
    'program "{name}": {reason}': "Programa «{name}»: {reason}",
    "a program needs a name": "Un programa necesita un nombre.",
    "a point needs a name": "Un punto necesita un nombre.",
    "a {kind} needs a name": "Falta un nombre ({kind}).",
    "the {kind}'s name {name} begins or ends with a blank": "El nombre {name} ({kind}) empieza o termina con un "
    "espacio.",
    "the {kind}'s name {name}... has {count} characters, more than {most}": "El nombre {name}... ({kind}) tiene "
    "{count} "
    "caracteres, más de {most}.",
    "the {kind}'s name {name} has the control character {bad} in it": "El nombre {name} ({kind}) tiene el carácter de "
    "control {bad}.",
    "the program's name {name} has {bad} in it: it becomes the name of a file": "El nombre {name} tiene {bad}: será el "
    "nombre de un archivo.",
    "the program's name {name} must not begin or end with a dot, nor end with {end}": "El nombre {name} no puede "
    "empezar "
    "ni terminar con un punto, ni terminar con {end}.",
    "folder cannot be {name}: no path has a NUL in it": "La carpeta no puede ser {name}.",
    "{path} is a file: the folder of programs is to be a folder": "{path} es un archivo: la carpeta de programas debe "
    "ser "
    "una carpeta.",
    "{path} has {size} bytes: no file of points or program is over {most}": "{path} tiene {size} bytes: ningún "
    "archivo de "
    "puntos o programa pasa de {most}.",
    "{path} cannot be read: {error}": "{path} no se puede leer ({error}).",
    "{path} is no UTF-8 text: {error}": "{path} no es texto UTF-8 ({error}).",
    "{path} cannot be written: it is there already, and is no file": "{path} no se puede escribir: ya existe, y no es "
    "un archivo.",
    "{path} cannot be written: {error}": "{path} no se puede escribir ({error}).",
    'it is for robot "{robot}", and this one is "{present}": correct robot = ...': "Es para el robot «{robot}», y "
    "este es "
    "«{present}»: corrija robot = ...",
    "this would never end: {names}; take one of these calls out, or use repeat": "No terminaría nunca ({names}): quite "
    "una de esas llamadas, o use repetir.",
    "programs call one another without end: {names}": "Los programas se llaman sin fin: {names}.",
    "calls are more than {most} deep: {names}": "Las llamadas pasan de {most} niveles: {names}.",
    '{robot} has no joint "{name}"': "{robot} no tiene una articulación «{name}».",
    '{robot} has no link "{name}"': "{robot} no tiene un eslabón «{name}».",
    '{robot} has no {kind} "{name}"': "{robot} no tiene {kind} «{name}».",
    'joint "{joint}" = {value} is beyond its limits, {limits}': "{joint} = {value} está más allá de sus límites, "
    "{limits}.",
    'point "{name}": joint "{joint}" = {value} is beyond its limits, {limits}': "Punto «{name}»: {joint} = {value} "
    "está "
    "más allá de sus límites, {limits}.",
    'point "{name}" has no value for joint {joints}: a point has all joints': "Al punto «{name}» le falta {joints}: un "
    "punto tiene todas las articulaciones.",
    'point "{name}": joint "{joint}" = {value} is no finite number, in rad or m': "Punto «{name}»: {joint} = {value} "
    "no "
    "es un número.",
    'point "{name}" has no joints, as joints = {example}': "El punto «{name}» no tiene joints, como en joints = "
    "{example}.",
    'point "{name}" has no key "{key}"': "El punto «{name}» no tiene la clave «{key}».",
    'point "{name}": picture = {value} is no file beside the points': "Punto «{name}»: picture = {value} no es un "
    "archivo "
    "junto a los puntos.",
    "these are points of {robot}, and the robot is {present}": "Son puntos de {robot}, y este brazo es {present}.",
    'unknown key "{key}"': "La clave «{key}» no se conoce.",
    "points = {value} is no table of points, as [points.above]": "points = {value} no es una tabla de puntos, como "
    "[points.arriba].",
    "the picture ({size} bytes) is neither PNG nor JPEG": "La imagen ({size} bytes) no es PNG ni JPEG.",
    "the picture has {size} bytes, more than {most}": "La imagen tiene {size} bytes, más de {most}.",
    "{version}: this gemelo reads version = {known}": "{version}: este gemelo lee version = {known}.",
    "this is not TOML: {error}": "Esto no es TOML ({error}).",
    "this is nested far too deep": "Esto está anidado demasiado hondo.",
    'robot = {value} is not a text in quotes, as "ready"': "robot = {value} no es un texto entre comillas.",
    "steps = {value} is no list of steps, as {example}": "steps = {value} no es una lista de pasos, como {example}.",
    "repeats are nested more than {most} deep: make a program of it, and call it": "Las repeticiones pasan de {most} "
    "niveles: haga de ello un programa, y llámelo.",
    "a program has at most {most} steps: make several, and call them": "Un programa tiene {most} pasos como mucho: "
    "haga "
    "varios, y llámelos.",
    "{value} is no step, as {example}": "{value} no es un paso, como {example}.",
    'there is no step "{name}"': "No hay un paso «{name}».",
    "do = {value} is not one of {names}": "do = {value} no es uno de {names}.",
    "a step says what it does: do = one of {names}": "Un paso dice lo que hace: do = uno de {names}.",
    '{step} has no key "{key}"': "{step} no tiene la clave «{key}».",
    '{step} needs "{key}": {expected}': "A {step} le falta «{key}» ({expected}).",
    "{key} = {value} is not {expected}": "{key} = {value} no vale ({expected}).",
    'frame = "{frame}" says along which axes an offset is: it goes with offset alone': "frame = «{frame}» solo va con "
    "offset.",
    "{key} says how the tool is turned at a position: give position too": "{key} solo va con position.",
    "say how the tool is turned once, not by {names}": "Diga una sola vez cómo se gira la herramienta, no con {names}.",
    "along = [0, 0, 0] is no direction": "along = [0, 0, 0] no es una dirección.",
    "an arc goes by one of through and center": "Un arco va por through o por center, uno de los dos.",
    "an arc is the tool's: give point, position or offset, not joints or a state": "Un arco es de la herramienta: va "
    "a un "
    "punto, no a una posición con nombre.",
    "a sensor is waited for with one of above and below": "Se espera a un sensor por encima o por debajo, uno de los "
    "dos.",
    "share = {value} is not above 0% and at most 100%": "La velocidad {value} debe ser más de 0 % y como mucho 100 %.",
    "count = {value} is not 1 to {most}": "Se repite de 1 a {most} veces, no {value}.",
    "a repeat needs steps: steps = [...]": "Una repetición necesita pasos: muévalos dentro de ella.",
    "{name} is {value}: it must be finite": "{name} es {value}: debe ser un número.",
    'joint "{joint}" is {value}: it must be finite': "{joint} es {value}: debe ser un número.",
    "{name} = {value} is not {least} to {most}": "{name} = {value} no está entre {least} y {most}.",
    '{name} = {value} is not {least} to {most}: if it is in mm, write "{guess}"': "{name} = {value} no está entre "
    "{least} y {most}: si son mm, escriba «{guess}».",
    "a motion goes to one of {names}: none is given": "Falta adónde va el movimiento: uno de {names}.",
    "a motion goes to one of {names}: not {given} at once": "Un movimiento va a uno de {names}, no a {given} a la vez.",
    '"{text}" is no step: write its number, and after a dot that within a repeat or call: 3.1': "«{text}» no es un "
    "paso: "
    "escriba su número, como 3.1.",
    'sensor "{name}" has no reading, not above {limit}, after {time} s': "El sensor «{name}» no da lectura tras "
    "{time} s; "
    "se esperaba más de {limit}.",
    'sensor "{name}" has no reading, not below {limit}, after {time} s': "El sensor «{name}» no da lectura tras "
    "{time} s; "
    "se esperaba menos de {limit}.",
    'sensor "{name}" reads {value}, not above {limit}, after {time} s': "El sensor «{name}» da {value} tras {time} s; "
    "se "
    "esperaba más de {limit}.",
    'sensor "{name}" reads {value}, not below {limit}, after {time} s': "El sensor «{name}» da {value} tras {time} s; "
    "se "
    "esperaba menos de {limit}.",
    "it is planned when the thing is seen": "Se planifica cuando se ve la cosa.",
    "how long the sensor lets the arm wait is not known": "No se sabe cuánto hará esperar el sensor.",
    "only the first {count} legs were checked: step {step} on they are not": "Solo se revisaron los primeros {count} "
    "tramos; desde el paso {step} no.",
    "nothing after step {step} was planned: where the arm would be is not known": "Tras el paso {step} no se planificó "
    "nada: no se sabe dónde estaría el brazo.",
    'planned in the scene as it is now, without step {step} ("{text}")': "Planificado en la escena como está ahora, "
    "sin "
    "el paso {step}.",
    "blend has no effect: no motion of the same kind and speed follows at once": "El redondeo no tiene efecto: no "
    "sigue "
    "otro movimiento igual.",
    "{reason}; {more}": "{reason} {more}",
}
