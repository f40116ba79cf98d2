"""The table of faults: what each does to a site, how it is healed, and what a person may have to do afterwards."""

from __future__ import annotations

import signal
from dataclasses import dataclass

from gemelo.schemas.deployment import Wire
from gemelo.tools.chaos.flutters import fluttering_holds, fluttering_stops, goal_and_stop
from gemelo.tools.chaos.injections import (
    Begin,
    Heal,
    changed_frames,
    clocks_set_back,
    clocks_stepped,
    cut,
    deaf,
    disk_freed,
    disk_full,
    doubled_frames,
    frames_of_noise,
    frozen,
    garbled,
    garbled_line,
    healed,
    healed_line,
    held,
    injected,
    killed,
    lossy,
    lossy_line,
    noise_on_the_bus,
    nothing,
    one_of_twins_is_left,
    released,
    restarted,
    resumed,
    run_folder_freed,
    run_folder_full,
    run_folder_read_only,
    run_folder_writable,
    signalled,
    slipped,
    slowed,
    spoiled_line,
    stalled,
    stopped,
    thawed,
    twin,
    twin_client_left,
    twin_gave_way,
    twin_of_a_frozen,
    twin_of_the_devices_client,
    unplugged_line,
    with_descriptors,
    without_descriptors,
    worker_killed,
)
from gemelo.tools.chaos.replays import (
    by_another_client,
    by_the_same_client,
    replayed_after_a_restart,
    replayed_after_a_stop,
    replayed_during_another_move,
    replayed_later,
)
from gemelo.tools.chaos.streams import dying_stream, replayed_stream, stalling_stream, stream_of_two

READY = 20.0  # [s] after the heal in which every process is ready again: docs/inside/failures.md, on a busy machine


@dataclass(frozen=True)
class Fault:
    """One row. `lasts` [s] from `begin` to `heal`."""

    name: str
    about: str
    begin: Begin
    lasts: tuple[float, float] = (0.0, 0.0)
    heal: Heal = nothing
    boots: bool = False  # the device starts anew: it must be referenced
    trips: bool = False  # it ends in Fault or EStop, which a person leaves
    slips: bool = False  # the shafts may have moved without their counters
    mutes: bool = False  # records may be lost while it lasts: the logger or the router is away
    of: str = ""  # the process that it is done to; empty: to none or to several
    wire: Wire = Wire.MQTT  # between gateway and device, from before the move on


SHORT, LONG = (0.05, 0.6), (0.8, 3.0)  # [s] within what motion and clients bear, and beyond it
# They take no part in a move that has begun.
BYSTANDERS = ("state_publisher", "planner", "visualizer", "viewer", "panel", "camera", "detector")
CLOSED_BY_ITS_USER = "viewer"  # and not started anew, where it is asked to end
RECORDED_THROUGH = ("router", "logger")
# The device's own twin is another device, of which the arm would have two.
ALONE = ("router", "broker", "stepper_gateway", "logger", *BYSTANDERS)
NAMED = tuple(name for name in ALONE if name not in ("router", "broker", "viewer", "panel"))  # others by their port
SERIAL = Wire.SERIAL
FAULTS: tuple[Fault, ...] = (
    *(Fault(f"kill {name}", "kill -9", killed(name), of=name) for name in (*BYSTANDERS, "stepper_gateway", "broker")),
    Fault("kill router", "kill -9", killed("router"), mutes=True),
    Fault("kill logger", "kill -9", killed("logger"), mutes=True),
    Fault("kill virtual_esp32", "kill -9 of the device", killed("virtual_esp32"), boots=True),
    Fault("kill planner worker", "kill -9 of a worker process", worker_killed),
    *(
        Fault(f"restart {name}", "SIGTERM", restarted(name), of=name)
        for name in (*BYSTANDERS, "stepper_gateway", "broker") if name != CLOSED_BY_ITS_USER
    ),
    Fault("restart router", "SIGTERM", restarted("router"), mutes=True),
    Fault("restart logger", "SIGTERM", restarted("logger"), mutes=True),
    Fault("restart virtual_esp32", "SIGTERM to the device", restarted("virtual_esp32"), boots=True),
    *(
        Fault(f"freeze {name} {length}", "SIGSTOP, then SIGCONT", frozen(name), lasts, thawed(name),
              mutes=name in ("router", "logger"), of=name)
        for name in ("stepper_gateway", "broker", "router", "virtual_esp32", "logger", *BYSTANDERS)
        for length, lasts in (("shortly", SHORT), ("long", LONG))
    ),
    *(
        Fault(f"{number.name} {name}", "as from a terminal that is closed", signalled(name, number),
              mutes=name in RECORDED_THROUGH, boots=name == "virtual_esp32", of=name)
        for name in (*ALONE, "virtual_esp32") for number in (signal.SIGHUP, signal.SIGQUIT)
    ),
    *(
        Fault(f"twin {name}", "a second one is started, and gives way", twin(name), heal=twin_gave_way, of=name)
        for name in ALONE
    ),
    *(
        Fault(f"twin of a frozen {name}", "a second one in its place, then it goes on", twin_of_a_frozen(name),
              heal=one_of_twins_is_left, mutes=name == "logger", of=name)
        for name in NAMED
    ),
    Fault("twin of the device's client", "its id at the broker is another's too", twin_of_the_devices_client, LONG,
          twin_client_left),
    Fault("cut link", "the link to the broker is cut", cut, SHORT, healed),
    Fault("cut link long", "the link to the broker is cut", cut, LONG, healed),
    Fault("stall link", "connections stay open, nothing passes", stalled, SHORT, healed),
    Fault("stall link long", "connections stay open, nothing passes", stalled, LONG, healed),
    *(
        Fault(f"deaf {end}{length}", f"nothing reaches the {end} over a link that is open", deaf(end == "device"),
              lasts, healed)
        for end in ("device", "host") for length, lasts in (("", SHORT), (" long", LONG))
    ),
    Fault("slow link", "every piece is late", slowed, LONG, healed),
    Fault("lossy link", "frames of QoS 0 never arrive", lossy, LONG, healed),
    Fault("garble link", "bits change on the way", garbled, LONG, healed),
    Fault("lossy serial line", "runs of bytes never arrive", lossy_line, LONG, healed_line, wire=SERIAL),
    Fault("garbled serial line", "bits change on the way", garbled_line, LONG, healed_line, wire=SERIAL),
    Fault("spoiled serial line", "bytes are lost and changed", spoiled_line, LONG, healed_line, wire=SERIAL),
    Fault("unplugged serial line", "there is no port", unplugged_line, (0.2, 3.0), healed_line, wire=SERIAL),
    Fault("doubled frames", "frames of the wire are said again", doubled_frames),
    Fault("changed frames", "frames of the wire are said with bytes changed", changed_frames),
    Fault("noise on the wire", "random bytes on the broker's topics", frames_of_noise),
    Fault("noise on the bus", "random bytes on every key", noise_on_the_bus),
    Fault("device offline", "its network is away", injected("offline", (0.2, 3.0)), (0.2, 3.0)),
    Fault("device frozen", "its path task hangs", injected("freeze", (0.05, 2.0)), (0.05, 2.0), trips=True),
    Fault("device reboots", "it starts anew", injected("reboot"), boots=True),
    Fault("host clock steps", "the wall clock of all processes steps, and back", clocks_stepped(True), LONG,
          clocks_set_back),
    Fault("one clock steps", "the wall clock of one process steps, and back", clocks_stepped(False), LONG,
          clocks_set_back),
    Fault("clock drifts", "the device's clock is fast or slow", injected("drift", (-400.0, 400.0)), LONG,
          lambda site: site.arm.device.inject("drift", value=0.0)),
    Fault("e-stop", "pressed and released", injected("estop"), SHORT, released("estop"), trips=True, slips=True),
    Fault("blocked joint", "its shaft is held fast", injected("block", on_joint=True), SHORT, released("block"),
          slips=True),
    Fault("slipping joint", "its shaft slips", slipped, slips=True),
    Fault("disk full", "the logger cannot write", disk_full, LONG, disk_freed, mutes=True),
    Fault("run folder full", "no process can write a file of its own", run_folder_full, LONG, run_folder_freed),
    Fault("run folder read-only", "its disk has failed", run_folder_read_only, LONG, run_folder_writable),
    Fault("no descriptors", "a process gets no file, socket or pipe", without_descriptors, LONG, with_descriptors,
          mutes=True),
    Fault("stop", "a person's stop", stopped),
    Fault("hold", "a person's hold, and go on", held, SHORT, resumed),
    Fault("flutter of holds", "many holds and resumes", fluttering_holds, heal=resumed),
    Fault("flutter of stops", "many moves, each stopped soon", fluttering_stops),
    Fault("goal and stop", "in one breath", goal_and_stop),
    Fault("stream dies", "no target follows the last one", dying_stream),
    Fault("stream stalls", "targets come in bursts", stalling_stream),
    Fault("stream replayed", "older targets between the newer", replayed_stream),
    Fault("stream of two", "two clients send targets", stream_of_two),
    Fault("goal replayed", "by its client, after its end", replayed_later(by_the_same_client)),
    Fault("goal replayed by another", "after its end", replayed_later(by_another_client)),
    Fault("goal replayed after a restart", "of the gateway", replayed_after_a_restart),
    Fault("goal replayed after a stop", "by its client or another", replayed_after_a_stop),
    Fault("goal replayed during a move", "by its client or another", replayed_during_another_move),
)  # fmt: skip
