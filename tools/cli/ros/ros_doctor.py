"""`gemelo ros doctor`: what keeps ROS 2 from seeing the arm, and the lines that every terminal of ROS needs."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.ros_wire.graph import entities, nodes, others_hashes
from gemelo.libraries.runtime.ros_wire.names import Entity, NodeName
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because, remedy
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.parser import Options
from gemelo.tools.cli.watch.doctor import Diagnosis, Verdict, as_rows, deployment_here, print_diagnoses

ROS_PORT = 7447  # of rmw_zenohd, unless it is told another one
LINES = (
    "export RMW_IMPLEMENTATION=rmw_zenoh_cpp",
    'export ZENOH_CONFIG_OVERRIDE=\'mode="client";connect/endpoints=["{router}"]\'',
)  # of a shell


def run(options: Options) -> ExitCode:
    """Prints every diagnosis, then what to copy; FAILED if one of them is an error."""
    deployment = deployment_here()
    found = list(diagnoses(deployment))
    if options.json:
        print(msgspec.json.encode(as_rows(found)).decode())
    else:
        print_diagnoses(found)
        if deployment.ros.router:
            print("\n" + sentence(because("ros.doctor.copy")))
            print("\n".join(LINES).replace("{router}", deployment.ros.router))
    return ExitCode.FAILED if any(each.verdict is Verdict.ERROR for each in found) else ExitCode.OK


def diagnoses(deployment: Deployment) -> Iterator[Diagnosis]:
    """Of our router, of the router of ROS, and of what is declared there."""
    yield from _own_router(deployment)
    section, elsewhere = deployment.ros, remedy("ros_router", port=deployment.router.port)
    if not section.router:
        yield Diagnosis(Verdict.ERROR, "ROS router", because("ros.router.none", elsewhere))
        return
    try:
        graph = entities(section.router)
    except BusError as error:
        yield Diagnosis(Verdict.ERROR, "ROS router", error.reason)
        return
    yield Diagnosis(Verdict.OK, "ROS router", because("ros.doctor.router", router=section.router))
    yield from _graph(graph, NodeName(section.node, section.namespace.strip("/"), section.domain))


def _own_router(deployment: Deployment) -> Iterator[Diagnosis]:
    """Nodes of ROS with the usual settings join whoever has their port, and do not find one another at our router."""
    router = deployment.router
    if router.tls:
        yield Diagnosis(Verdict.OK, "router", because("ros.doctor.locked"))
        return
    try:
        found = nodes(entities(f"tcp/{router.host}:{router.port}"))
    except BusError:
        yield Diagnosis(Verdict.OK, "router", because("ros.doctor.no_twin", host=router.host, port=router.port))
        return
    if found:
        why = because("ros.doctor.astray", remedy("ros_router", port=router.port), port=router.port, nodes=found)
        yield Diagnosis(Verdict.ERROR, "router", why)
    elif router.port == ROS_PORT:
        why = because("ros.doctor.port", remedy("ros_other_port"), port=router.port)
        yield Diagnosis(Verdict.WARNING, "router", why)
    else:
        yield Diagnosis(Verdict.OK, "router", because("ros.doctor.apart", port=router.port))


def _graph(graph: tuple[Entity, ...], own: NodeName) -> Iterator[Diagnosis]:
    name, found = own.full("~/").rstrip("/"), nodes(graph)
    others = tuple(each for each in found if each != name)
    if name not in found:
        yield Diagnosis(Verdict.ERROR, "bridge", because("ros.doctor.no_bridge", remedy("ros_start_bridge"), node=name))
    else:
        yield Diagnosis(Verdict.OK, "bridge", because("ros.doctor.bridge", node=name))
    if others:
        yield Diagnosis(Verdict.OK, "ROS nodes", because("ros.doctor.nodes", nodes=others))
    else:
        yield Diagnosis(Verdict.WARNING, "ROS nodes", because("ros.doctor.alone", remedy("ros_environment")))
    for each in others_hashes(graph, name):
        what = {"node": each.node, "name": each.name, "type": each.type, "hash": each.hash}
        yield Diagnosis(Verdict.WARNING, "hashes", because("ros.doctor.hash", remedy("ros_same_messages"), **what))
