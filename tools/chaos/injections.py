"""The faults that chaos injects into a site in the middle of a move, and the way each is healed."""

from __future__ import annotations

import math
import os
import resource
import signal
from collections.abc import Callable
from contextlib import suppress
from random import Random

import psutil

import gemelo
from gemelo.schemas.reasons import because
from gemelo.tools.chaos.descriptors import give_descriptors, take_descriptors
from gemelo.tools.chaos.noisy_line import NoisyLine
from gemelo.tools.chaos.site import ChaosSite, program
from gemelo.tools.chaos.slow_link import OneWay, Way
from gemelo.tools.chaos.twins import TwinClient, TwinProcess
from gemelo.tools.stack.stack import StackError

Begin = Callable[[ChaosSite, Random], str]  # does it; the words for what was chosen
Heal = Callable[[ChaosSite], None]

FEW, MANY = 20, 200  # frames
SLIP = 0.05  # of a joint's travel, to either side
LEAST_STEP, MOST_STEP = 0.2, 3600.0  # [s] of a clock


def nothing(site: ChaosSite) -> None:
    """What heals by itself."""


def killed(name: str) -> Begin:
    def begin(site: ChaosSite, random: Random) -> str:
        site.stack.kill(name)
        return f"kill -9 {name}"

    return begin


def restarted(name: str) -> Begin:
    def begin(site: ChaosSite, random: Random) -> str:
        site.stack.kill(name, signal.SIGTERM)
        return f"restart {name}"

    return begin


def signalled(name: str, number: signal.Signals) -> Begin:
    """A signal by which a terminal ends what was started in it."""

    def begin(site: ChaosSite, random: Random) -> str:
        with suppress(PermissionError, ProcessLookupError):  # mosquitto gives up root's rights
            _leave_no_core(site.stack.pid(name))
        site.stack.kill(name, number)
        return f"{number.name} to {name}"

    return begin


def _leave_no_core(pid: int) -> None:
    """SIGQUIT has the kernel write what was in memory, where its limit allows that; raises `OSError`."""
    _, most = resource.prlimit(pid, resource.RLIMIT_CORE)
    resource.prlimit(pid, resource.RLIMIT_CORE, (0, most))


def twin(name: str) -> Begin:
    """A second process beside one that lives: it gives way."""

    def begin(site: ChaosSite, random: Random) -> str:
        site.twin = TwinProcess(site.stack, name)
        site.twin.start()
        return f"a second {name}"

    return begin


def twin_gave_way(site: ChaosSite) -> None:
    site.found += site.end_twin(TwinProcess.gave_way)


def twin_of_a_frozen(name: str) -> Begin:
    """A second process in the place of one that is frozen, which then goes on: one of both gives way."""

    def begin(site: ChaosSite, random: Random) -> str:
        site.twin = TwinProcess(site.stack, name)
        site.stack.kill(name, signal.SIGSTOP)
        site.twin.start()
        if not site.twin.has_begun():
            site.found.append(because("chaos.twin.not_taken", name=name))
        thawed(name)(site)
        return f"freeze {name}, a second one in its place, then thaw"

    return begin


def one_of_twins_is_left(site: ChaosSite) -> None:
    site.found += site.end_twin(TwinProcess.one_is_left)


def twin_of_the_devices_client(site: ChaosSite, random: Random) -> str:
    """A client of the broker with the id of the device, as of a copy of its card."""
    prefix = f"gemelo-device-{site.arm.description.device.name}-"
    client_id = site.link.newest_client(prefix)
    if not client_id:
        raise StackError(because("chaos.no_client", begin=prefix))
    comes_back = random.random() < 0.5
    site.twin_client = TwinClient(site.broker_port, client_id, comes_back)
    return f"a second client {prefix}..., {'again and again' if comes_back else 'once'}"


def twin_client_left(site: ChaosSite) -> None:
    client, site.twin_client = site.twin_client, None
    if client is not None:
        client.close()


def deaf(to_device: bool) -> Begin:
    """Nothing passes in one direction, on the gateway's or the device's side of the broker; the other one is whole."""

    def begin(site: ChaosSite, random: Random) -> str:
        of_device = random.random() < 0.5
        way = Way.FROM_BROKER if of_device is to_device else Way.TO_BROKER
        client = "gemelo-device-" if of_device else "gemelo-gateway-"
        site.link.stalled_ways = frozenset({OneWay(client, way)})
        side = "the device's" if of_device else "the gateway's"
        return f"nothing {'to' if to_device else 'from'} the device, on {side} side of the broker"

    return begin


def line_of(site: ChaosSite) -> NoisyLine:
    """Raises `StackError` where the wire is no serial line."""
    if site.line is None:
        raise StackError(because("chaos.no_line"))
    return site.line


def lossy_line(site: ChaosSite, random: Random) -> str:
    line_of(site).losing = random.uniform(0.01, 0.1)
    return f"lose bytes of {line_of(site).losing:.0%} of the pieces on the serial line"


def garbled_line(site: ChaosSite, random: Random) -> str:
    line_of(site).garbling = random.uniform(0.01, 0.1)
    return f"change bits in {line_of(site).garbling:.0%} of the pieces on the serial line"


def spoiled_line(site: ChaosSite, random: Random) -> str:
    line_of(site).losing, line_of(site).garbling = random.uniform(0.01, 0.05), random.uniform(0.01, 0.05)
    return "lose and change bytes on the serial line"


def unplugged_line(site: ChaosSite, random: Random) -> str:
    line_of(site).unplug()
    return "unplug the serial line"


def healed_line(site: ChaosSite) -> None:
    line_of(site).heal()


def frozen(name: str) -> Begin:
    def begin(site: ChaosSite, random: Random) -> str:
        site.stack.kill(name, signal.SIGSTOP)
        return f"freeze {name}"

    return begin


def thawed(name: str) -> Heal:
    def heal(site: ChaosSite) -> None:
        with suppress(StackError, ProcessLookupError):
            site.stack.kill(name, signal.SIGCONT)

    return heal


def injected(what: str, value: tuple[float, float] = (1.0, 1.0), on_joint: bool = False) -> Begin:
    """What a person's hand does: `what` with a value between both, in the unit of `device/inject`."""

    def begin(site: ChaosSite, random: Random) -> str:
        target = random.choice(site.arm.joint_names) if on_joint else ""
        amount = random.uniform(*value)
        site.arm.device.inject(what, target, round(amount, 3))
        return f"{what} {target} {amount:.3g}".replace("  ", " ")

    return begin


def slipped(site: ChaosSite, random: Random) -> str:
    """A shaft slips as far as something can push it: not beyond the ends of its joint."""
    joint = random.choice(site.arm.description.joints)
    at, travel = site.arm.joints[joint.name], min(joint.upper - joint.lower, math.tau)
    to = joint.clamp(at + random.uniform(-SLIP, SLIP) * travel)
    steps = round((to - at) * joint.steps.per_unit)
    site.arm.device.inject("slip", joint.name, steps)
    return f"slip {joint.name} {steps}"


def released(what: str) -> Heal:
    def heal(site: ChaosSite) -> None:
        for target in site.arm.joint_names if what == "block" else ("",):
            site.arm.device.inject(what, target, 0.0)

    return heal


def cut(site: ChaosSite, random: Random) -> str:
    site.link.cut()
    return "cut the link to the broker"


def stalled(site: ChaosSite, random: Random) -> str:
    site.link.is_stalled = True
    return "stall the link to the broker"


def slowed(site: ChaosSite, random: Random) -> str:
    site.link.delay = random.uniform(0.02, 0.15)
    return f"slow the link to the broker by {site.link.delay * 1e3:.0f} ms"


def garbled(site: ChaosSite, random: Random) -> str:
    site.link.garbling = random.uniform(0.01, 0.1)
    return f"garble {site.link.garbling:.0%} of what passes the link to the broker"


def lossy(site: ChaosSite, random: Random) -> str:
    site.link.losing = random.uniform(0.02, 0.3)
    return f"lose {site.link.losing:.0%} of the frames of QoS 0"


def healed(site: ChaosSite) -> None:
    site.link.heal()


def doubled_frames(site: ChaosSite, random: Random) -> str:
    count = random.randint(FEW, MANY)
    site.wire.repeat(random, count)
    return f"say {count} frames again"


def changed_frames(site: ChaosSite, random: Random) -> str:
    count = random.randint(FEW, MANY)
    site.wire.garble(random, count)
    return f"say {count} frames with bytes changed"


def frames_of_noise(site: ChaosSite, random: Random) -> str:
    count = random.randint(FEW, MANY)
    site.wire.noise(random, count)
    return f"say {count} frames of random bytes"


def noise_on_the_bus(site: ChaosSite, random: Random) -> str:
    site.bus.noise(random)
    return "random bytes on every key of the bus"


def worker_killed(site: ChaosSite, random: Random) -> str:
    children = psutil.Process(site.stack.pid("planner")).children(recursive=True)
    if not children:
        return "no worker of the planner to kill"
    os.kill(random.choice(children).pid, signal.SIGKILL)
    return "kill -9 a worker of the planner"


def disk_full(site: ChaosSite, random: Random) -> str:
    resource.prlimit(site.stack.pid("logger"), resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    return "no room on the logger's disk"


def disk_freed(site: ChaosSite) -> None:
    with suppress(StackError, ProcessLookupError):
        unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
        resource.prlimit(site.stack.pid("logger"), resource.RLIMIT_FSIZE, unlimited)


def run_folder_full(site: ChaosSite, random: Random) -> str:
    """No file of any process grows; without root, who has no disk of its own for it, by a limit of each process."""
    if site.disk is not None:
        site.disk.fill()
    else:
        for pid in site.stack.pids().values():
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    return "no room on the disk of the run folder"


def run_folder_freed(site: ChaosSite) -> None:
    if site.disk is not None:
        site.disk.free()
        return
    for pid in site.stack.pids().values():
        with suppress(ProcessLookupError):
            resource.prlimit(pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))


def run_folder_read_only(site: ChaosSite, random: Random) -> str:
    """As Linux makes a disk that fails; without root by the folder's mode."""
    if site.disk is not None:
        site.disk.make_read_only()
    else:
        site.stack.run.chmod(0o555)
    return "the disk of the run folder is read-only"


def run_folder_writable(site: ChaosSite) -> None:
    if site.disk is not None:
        site.disk.make_writable()
    else:
        site.stack.run.chmod(0o755)


def without_descriptors(site: ChaosSite, random: Random) -> str:
    """One that runs as the user of chaos: mosquitto gives up root's rights, and its limits are not ours to set."""
    running = sorted(site.stack.pids().items())
    for name, pid in random.sample(running, len(running)):
        with suppress(PermissionError):
            take_descriptors(pid)
            return f"{name} gets no descriptor"
    return "no process whose descriptors could be taken"


def with_descriptors(site: ChaosSite) -> None:
    for pid in site.stack.pids().values():
        with suppress(PermissionError):
            give_descriptors(pid)


def clocks_stepped(of_all: bool) -> Begin:
    """The wall clock of the host, or of one process as if it were on a host of its own, steps to either side."""

    def begin(site: ChaosSite, random: Random) -> str:
        ahead = random.choice((-1.0, 1.0)) * LEAST_STEP * (MOST_STEP / LEAST_STEP) ** random.random()
        names = site.clocks.names if of_all else (random.choice([*map(program, site.stack.processes)]),)
        site.clocks.set_ahead(ahead, names)
        return f"the clock of {'the host' if of_all else names[0]} steps by {ahead:+.1f} s"

    return begin


def clocks_set_back(site: ChaosSite) -> None:
    site.clocks.set_ahead(0.0)


def stopped(site: ChaosSite, random: Random) -> str:
    site.arm.stop()
    return "a person's stop"


def held(site: ChaosSite, random: Random) -> str:
    site.arm.hold()
    return "a person's hold"


def resumed(site: ChaosSite) -> None:
    with suppress(gemelo.Error):
        site.arm.resume()
