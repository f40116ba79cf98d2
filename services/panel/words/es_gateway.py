"""Spanish of the gateway's sentences about the device, commands, the gripper and control.

A key is the sentence as the gateway says it; `sentences.py` says how it is found.
"""

from __future__ import annotations

# Where the device is, and why nothing can begin
_DEVICE: dict[str, str] = {
    'no link to device "{name}": {why}': "No hay enlace con el equipo «{name}» ({why}).",
    "no connection yet": "aún no hay conexión",
    "no connection yet to {access}": "aún no hay conexión con {access}",
    "the connection to {access} is lost ({why})": "se perdió la conexión con {access} ({why})",
    'device "{name}" is offline: switch it on, or check its network': "El equipo «{name}» no está conectado: "
    "enciéndalo, o revise su red.",
    'device "{name}" has not been heard: is it switched on, does it use the same broker, and does the broker\'s ACL '
    "let "
    "it write?": "Aún no se oye al equipo «{name}»: ¿está encendido, usa el mismo broker, y le deja escribir la ACL?",
    'device "{name}" is silent for more than {time} s: check its power and network': "El equipo «{name}» calla desde "
    "hace más de {time} s: revise su corriente y su red.",
    'device "{name}" has not said yet who it is: wait a second, or restart it': "El equipo «{name}» aún no dijo quién "
    "es: espere un segundo, o reinícielo.",
    'the clock of device "{name}" is not known yet: try again in a second': "Aún no se conoce el reloj del equipo "
    "«{name}»: pruebe otra vez en un segundo.",
    'device "{name}" is asked by another gateway too: nothing moves until there is one. End the other: a forgotten '
    "`make up`, a second host, or a process that was stopped and goes on": "Otro gateway pregunta también al equipo "
    "«{name}»: nada se mueve hasta que quede uno. Termine el otro: un `make up` olvidado, otro ordenador, o un proceso "
    "que estuvo detenido y continúa.",
    'device "{name}" speaks and does not hear: its states arrive, and it answers nothing that is sent to it. Likely '
    "causes: a loose TX wire, a broker's ACL that denies the device its subscription, or two boards or programs with "
    "one client id. Without heartbeats it holds by itself": "El equipo «{name}» habla y no oye: sus estados llegan, y "
    "no responde a nada de lo que se le envía. Causas probables: un cable TX suelto, una ACL del broker que no deja "
    "suscribirse al equipo, o dos placas o programas con un mismo identificador de cliente. Sin latidos se detiene "
    "solo.",
    "{told}; its last state, {age} s old: it moves, in mode {mode}": "{told} Su último estado, de hace {age} s: se "
    "mueve, en modo «{mode}».",
    "{told}; its last state, {age} s old: it stands, in mode {mode}": "{told} Su último estado, de hace {age} s: está "
    "quieto, en modo «{mode}».",
    'device "{name}" has not said yet where its joints stand: wait a second': "El equipo «{name}» aún no dijo dónde "
    "están sus articulaciones: espere un segundo.",
    'device "{name}" looks for its home switches: wait until it has found them, or run `gemelo stop`': "El equipo "
    "«{name}» busca el origen: espere a que lo encuentre, o pulse Parar.",
    'device "{name}" holds: run `gemelo resume` or `gemelo stop` first': "El equipo «{name}» está en pausa: pulse "
    "antes "
    "Continuar, o Parar.",
    'device "{name}" has a fault: {reason}': "El equipo «{name}» tiene un fallo: {reason}",
    'device "{name}" is in mode {mode}: wait until it is IDLE': "El equipo «{name}» está en modo «{mode}»: espere a "
    "que esté en reposo.",
    'device "{name}" is disarmed: run `gemelo device arm`; then {remedy}': "Los motores del equipo «{name}» están "
    "apagados: enciéndalos en la pestaña Equipo; luego {remedy}",
    'device "{name}" does not know where {joints} stands: {remedy}': "El equipo «{name}» no sabe dónde está {joints}: "
    "{remedy}",
    "put the arm into its reference pose and run `gemelo reference`": "ponga el brazo en su posición de referencia y "
    "pulse «Declarar la referencia».",
    "run `gemelo home`, or put the arm into its reference pose and run `gemelo reference`": "pulse «Buscar el origen», "
    "o ponga el brazo en su posición de referencia y pulse «Declarar la referencia».",
    'the emergency stop "{input}" of device "{name}" is pressed: release it, run `gemelo reset`, `gemelo device arm`, '
    "then `gemelo home` or `gemelo reference`": "La parada de emergencia «{input}» del equipo «{name}» está pulsada: "
    "suéltela, borre el fallo, encienda los motores, y busque el origen o declare la referencia.",
    'the emergency stop of device "{name}" was pressed: run `gemelo reset`, `gemelo device arm`, then `gemelo home` or '
    "`gemelo reference`": "Se pulsó la parada de emergencia del equipo «{name}»: borre el fallo, encienda los motores, "
    "y busque el origen o declare la referencia.",
    'device "{name}" refuses the configuration of robot.toml: {why}; correct it and start again': "El equipo «{name}» "
    "rechaza la configuración de robot.toml ({why}): corríjala y arranque otra vez.",
    'device "{name}" is being given its configuration ({sum}): wait a second': "El equipo «{name}» está recibiendo su "
    "configuración ({sum}): espere un segundo.",
    'device "{name}" works with configuration {present}, robot.toml asks for {sum}, and an armed device takes none: '
    "run "
    "`gemelo device config --push`, which disarms, configures and arms it": "El equipo «{name}» trabaja con la "
    "configuración {present}, robot.toml pide {sum}, y con los motores encendidos no toma ninguna: apáguelos.",
    "{reason}; the device says that it stands and answers nothing: does it hear this gateway? restart it, check its "
    "network": "{reason}; el equipo dice que está quieto y no responde a nada: ¿oye a esta pasarela? reinícielo, y "
    "revise su red.",
    "the device has not answered the configuration in time": "El equipo no respondió a tiempo a su configuración.",
    "the device was given another configuration ({sum})": "El equipo recibió otra configuración ({sum}).",
    "the device has another configuration": "El equipo tiene otra configuración.",
    'device "{name}" runs firmware {firmware}, and this gateway drives {least} and newer: `gemelo device update` '
    "brings it a newer one, or flash it over its cable (firmware/README.md)": "El equipo «{name}» ejecuta el firmware "
    "{firmware}, y este gateway solo mueve {least} y posteriores: actualícelo, o grábelo por cable "
    "(firmware/README.md).",
    "the device has restarted": "El equipo se reinició.",
    "the sketch was silent for {time} s with a message to do: it has started anew, lost its network or stood still, "
    "and where the arm is is not known. Put it into its reference pose, then run `gemelo reference`": "El sketch calló "
    "{time} s con un mensaje por hacer: se reinició, perdió la red o se quedó parado, y no se sabe dónde está el "
    "brazo. Póngalo en su posición de referencia y pulse «Declarar la referencia».",
    "the broker has not passed on the last message of steps: it was lost with a connection, and where the arm is is "
    "not known. Put it into its reference pose, then run `gemelo reference`": "El broker no entregó el último mensaje "
    "de pasos: se perdió con una conexión, y no se sabe dónde está el brazo. Póngalo en su posición de referencia y "
    "pulse «Declarar la referencia».",
    'no link to device "{name}": no line was answered for {time} s: is the wire plugged in, is it this port, has the '
    "board {baud} baud? (port {port})": "El equipo «{name}» no respondió a ninguna línea en {time} s: ¿está el cable, "
    "es este puerto ({port}), trabaja la placa a {baud} baudios?",
    "no line was answered for {time} s: is the wire plugged in, is it this port, has the board {baud} baud? It was in "
    "a motion, and where the arm is is not known: run `gemelo reference` when it answers": "No se respondió a ninguna "
    "línea en {time} s: ¿está el cable, es este puerto, trabaja la placa a {baud} baudios? Estaba en movimiento y no "
    "se sabe dónde está el brazo: declare la referencia cuando responda.",
    "the device has restarted: its position and boot id are read anew": "El equipo se reinició: se lee de nuevo dónde "
    "está.",
    "the device is offline: {reason}": "El equipo no está conectado: {reason}",
    "the device is not usable: {reason}": "El equipo no se puede usar: {reason}",
    "{reason} (for {time} s)": "{reason} (desde hace {time} s)",
    '{count} devices call themselves "{name}": {known}: nothing moves until there is one. Switch one off, or give one '
    "another name: a forgotten `make up` in another folder, a virtual device beside a board, or two boards that were "
    "provisioned alike": "Hay más de un equipo que se llama «{name}» ({known}): nada se mueve hasta que quede uno. "
    "Apague uno, o dele otro nombre: un `make up` olvidado en otra carpeta, un equipo virtual junto a una placa, o dos "
    "placas configuradas igual.",
    "two planners live, {older} and {newer}: which scene stands around the arm is not known. The older one ends by "
    "itself within seconds; if not, end it": "Hay dos planificadores, {older} y {newer}: no se sabe qué escena rodea "
    "al brazo. El más viejo termina solo en segundos; si no, termínelo.",
    'something else than gemelo\'s firmware writes under the topics of device "{name}" ({kind}: {why}): an old '
    "sketch, or another program: end it, or give the device another name": "Algo que no es el firmware de gemelo "
    "escribe en los temas del equipo «{name}» ({kind}: {why}): un sketch viejo u otro programa: termínelo, o dé otro "
    "nombre al equipo.",
    "no reason is known": "no se sabe por qué.",
    "no reason was given": "no se dijo por qué.",
}

# Commands to the device
_COMMANDS: dict[str, str] = {
    "the device has not answered {command} yet: wait a moment": "El equipo aún no respondió a {command}: espere un "
    "momento.",
    "the device has not answered the commands before this one yet: wait a moment": "El equipo aún no respondió a las "
    "órdenes anteriores: espere un momento.",
    "the device has not answered {command} in time": "El equipo no respondió a tiempo a {command}.",
    "the device has not answered {command} in time, which was sent {times} times": "El equipo no respondió a tiempo a "
    "{command}, que se le envió {times} veces.",
    "the device has not answered {command} in time, which was sent {times} times: {reason}": "El equipo no respondió a "
    "tiempo a {command}, que se le envió {times} veces. {reason}",
    "{command} could not be sent: {reason}; the device holds by itself without heartbeats": "No se pudo enviar "
    "{command}. {reason} Sin latidos el equipo se detiene solo.",
    "a goal is being carried out: cancel it or run `gemelo stop` before {command}": "El brazo va hacia una meta: pulse "
    "Parar antes de {command}.",
    "the device refuses {command} in mode {mode}: {code}": "El equipo rechaza {command} en modo «{mode}»: {code}.",
    "the device refuses {command} in mode {mode}: {code}, {remedy}": "El equipo rechaza {command} en modo «{mode}» "
    "({code}): {remedy}",
    "it does not do that in this mode": "eso no lo hace en este modo.",
    "the position is beyond its soft limits": "esa posición está más allá de sus límites.",
    "its drivers are off, or only just on: run `gemelo device arm`, and wait a second": "sus motores están apagados, o "
    "recién encendidos: enciéndalos en la pestaña Equipo, y espere un segundo.",
    "its emergency stop is pressed: release it first": "su parada de emergencia está pulsada: suéltela antes.",
    "a joint has no home switch: give it a [joint.homing] in robot.toml, or run `gemelo reference`": "una articulación "
    "no tiene interruptor de origen: póngale un [joint.homing] en robot.toml, o declare la referencia.",
    "its firmware, or the dialect that it speaks, has no such command": "su firmware, o el dialecto que habla, no "
    "tiene "
    "esa orden.",
    "it has no such output, joint or value: see `gemelo device config`": "no tiene esa salida, articulación o valor.",
    "only a hold can be resumed; start a new goal": "solo se continúa una pausa; empiece otro movimiento.",
    "the arm must stand: run `gemelo stop`, or clear its fault with `gemelo reset`": "el brazo debe estar quieto: "
    "pulse "
    "Parar, o borre su fallo.",
    "the arm must stand: run `gemelo stop` first": "el brazo debe estar quieto: pulse antes Parar.",
    "clear its fault or emergency stop with `gemelo reset` first": "borre antes su fallo o su parada de emergencia.",
    "{named} joints are named and {given} positions given": "Se nombran {named} articulaciones y se dan {given} "
    "posiciones.",
    'joint "{joint}" has no home switch: put it into place by hand and run `gemelo reference`, or give it a '
    "[joint.homing] in robot.toml": "{joint} no tiene interruptor de origen: póngala a mano en su sitio y declare la "
    "referencia, o dele un [joint.homing] en robot.toml.",
    'joint "{joint}" has no [joint.homing] in robot.toml, so it cannot home: declare where it stands, '
    "arm.reference({command})": "{joint} no tiene [joint.homing] en robot.toml y no puede buscar su origen: declare la "
    "referencia.",
    "no joint has a [joint.homing] in robot.toml: declare where they stand, arm.reference()": "Ninguna articulación "
    "tiene [joint.homing] en robot.toml: declare la referencia.",
    '{robot} has no output "{name}"': "{robot} no tiene una salida «{name}».",
    "a speed is 0 (stands) to 1 (as planned), not {value}": "Una velocidad va de 0 (quieto) a 1 (la del plan), no "
    "{value}.",
    'device "{name}" is a real one: press its buttons by hand; only a virtual device\'s are pressed by a request': "El "
    "equipo «{name}» es real: pulse sus botones con la mano.",
    "{name} is a real device: only a virtual one takes this": "{name} es un equipo real: esto solo se le hace a uno "
    "virtual.",
    'there is no {kind} "{name}"': "No hay {kind} «{name}».",
    "stopped by a device command ({command})": "Lo detuvo una orden al equipo ({command}).",
    "{name} was asked for after it: ask again": "Después se pidió {name}: pídalo otra vez.",
    "refused: the device is in {mode}: wait, or arm.stop()": "El equipo está en modo «{mode}»: espere, o pulse Parar.",
    "the device refused the configuration: {reason}": "El equipo rechazó la configuración: {reason}",
    "homing ended after {time} s: {reason}": "La búsqueda del origen terminó tras {time} s: {reason}",
    "all joints are home": "todas las articulaciones están en su origen.",
    "the device went offline: {reason}": "el equipo dejó de estar conectado. {reason}",
    "the device has fallen silent: `gemelo device status`": "el equipo dejó de hablar: revise su corriente y su red.",
    "the device did not begin: `gemelo device status`": "el equipo no empezó: vea su modo en la pestaña Equipo.",
    "it has not ended after {time} s: arm.stop(), `gemelo device status`": "no terminó en {time} s: pulse Parar.",
    "the device ended it without {joints}": "el equipo terminó sin {joints}.",
    "the device heard nothing from stepper_gateway for too long and stopped: arm.home() again": "el equipo no oyó "
    "demasiado tiempo a stepper_gateway y se detuvo: busque el origen otra vez.",
    "it was stopped; the joints that were not home yet are unreferenced: arm.home() again": "se paró; las "
    "articulaciones que aún no estaban en su origen quedan sin referencia: búsquelo otra vez.",
}

# The gripper
_GRIPPER: dict[str, str] = {
    "{robot} has no gripper: write a [gripper] into its robot.toml": "{robot} no tiene pinza: escriba un [gripper] en "
    "su "
    "robot.toml.",
    "gripper: the emergency stop is pressed: release it and run `gemelo reset` first": "Pinza: la parada de emergencia "
    "está pulsada: suéltela y borre antes el fallo.",
    "gripper: max_effort is {value} N: write 0 for no bound, or more": "Pinza: la fuerza no puede ser {value} N.",
    "gripper: it presses with {effort} N and cannot be told to press with at most {value} N: leave max_effort out, or "
    "open it only as far as the object needs": "Pinza: aprieta con {effort} N y no puede apretar con {value} N como "
    "mucho: ábrala solo lo que necesita el objeto.",
    "gripper: {value} mm is not between its {closed} mm closed and {open} mm open: choose an opening between them, or "
    "correct [gripper] in robot.toml": "Pinza: {value} mm no está entre {closed} mm (cerrada) y {open} mm (abierta): "
    "elija una apertura entre las dos.",
    "gripper: {value} mm: output {output} knows only closed, {closed} mm, and open, {open} mm: choose one of them": (
        "Pinza: {value} mm: la salida {output} solo sabe cerrada, {closed} mm, y abierta, {open} mm."
    ),
    "gripper {status} at {value} mm: {reason}": "La pinza quedó en {value} mm: {reason}",
    "the gripper has not arrived: it stands at {value} mm after {time} s": "la pinza no llegó: está en {value} mm tras "
    "{time} s.",
    "the emergency stop is pressed": "la parada de emergencia está pulsada.",
    "the gripper was stopped, or switched by somebody else": "la pinza fue parada, o movida por otro.",
    'grip("{value}") is neither "open" nor "close": write one of them, or an opening in m': "La pinza se abre, se "
    "cierra, o va a una apertura; no «{value}».",
    "grip({value}) is not {closed} to {open} m between the jaws": "La pinza va de {closed} a {open} m, no a {value} m.",
    "grip({value}) is not {closed} to {open} m between the jaws: {value} mm is {metres}": "La pinza va de {closed} a "
    "{open} m, no a {value} m.",
}

# Control of the arm
_HELD = "{name} tiene el mando de {robot} desde las {clock} UTC (hace {age} s), en el nodo {node} de {host}"
_HOLDS = "{name} holds control of {robot}, since {clock} UTC ({age} s ago), from node {node} on {host}"
_ASK = ": ask for it, or run `gemelo control take --force`"
_ASK_ES = ": pídaselo, o pulse «Quitar el mando a quien lo tiene»."
_CONTROL: dict[str, str] = {
    _HOLDS + _ASK: _HELD + _ASK_ES,
    _HOLDS + ", and is gone for {gone} s" + _ASK: _HELD + ", y falta desde hace {gone} s" + _ASK_ES,
    "{name} holds control of {robot}, since {clock} UTC, from node {node} on {host}, and moves it"
    + _ASK: "{name} tiene el mando de {robot} desde las {clock} UTC, en el nodo {node} de {host}, y lo mueve" + _ASK_ES,
    "{name} holds control, from node {node} on {host}: see `gemelo control who`": "{name} tiene el mando, en el nodo "
    "{node} de {host}" + _ASK_ES,
    "{who} holds control, not you: nothing to give back": "El mando es de {who}, no suyo: no hay nada que devolver.",
    "nobody holds control: nothing to give back": "Nadie tiene el mando: no hay nada que devolver.",
    "{who} holds control, not you: nothing to share": "El mando es de {who}, no suyo: no hay nada que compartir.",
    "nobody holds control: nothing to share": "Nadie tiene el mando: no hay nada que compartir.",
    "refused: this connection does not hold control: nothing to give back": "Esta página no tiene el mando: no hay "
    "nada "
    "que devolver.",
    "refused: this connection has lost control of the arm, and {now}: {how} anew": "Esta página perdió el mando del "
    "brazo ({now}): tómelo otra vez.",
    "{who} is taking control of {robot}: nothing moves until the arm rests": "{who} está tomando el mando de {robot}: "
    "nada se mueve hasta que el brazo esté quieto.",
    "{who} is taking control of {robot} at this moment": "{who} está tomando el mando de {robot} en este momento.",
    "{who}, who holds control, is gone for {time} s: take control anew with `gemelo control take --force`": "{who}, "
    "que "
    "tiene el mando, falta desde hace {time} s: pulse «Quitar el mando a quien lo tiene».",
    "{who} takes control": "{who} toma el mando.",
    "{who}, who holds control, is gone": "{who}, que tiene el mando, ya no está.",
    "{who} has asked for control after you, with --force": "{who} pidió el mando después, a la fuerza.",
    "the node that asked for control is gone": "Quien pidió el mando ya no está.",
    "{count} nodes share this hold already: end one of them": "Ya comparten el mando {count} nodos: cierre uno.",
    "{name} ({count} characters) is no name: 1 to {most} that can be printed": "{name} ({count} caracteres) no es un "
    "nombre: de 1 a {most} que se puedan ver.",
    "a secret of {count} characters: {least} to {most} are needed": "Un secreto de {count} caracteres: hacen falta de "
    "{least} a {most}.",
    'client "{name}" is not the key of a liveliness token: `gemelo control take` sends its own': "«{name}» no es la "
    "clave de un cliente.",
    "the request does not say which session it comes from: use `gemelo control`, or its Python API": "No se sabe de "
    "qué "
    "sesión viene la petición.",
}

GATEWAY: dict[str, str] = _DEVICE | _COMMANDS | _GRIPPER | _CONTROL
