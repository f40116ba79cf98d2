"""Names on the wire of rmw_zenoh_cpp: keys of data, liveliness tokens, qualities of service and attachments.

As its own design document and README have them. `/` within a part of a token is written `%`, and an empty part is `%`.
"""

from __future__ import annotations

import struct
from enum import StrEnum
from typing import NamedTuple

TOKENS = "@ros2_lv"
NODE = "NN"
ATTACHMENT = struct.Struct("<qqB16s")  # sequence number, source time [ns], length of the GID, GID
GID = 16  # [bytes]
NO_GID = bytes(GID)
LEAST_NODE, LEAST_ENDPOINT = 9, 13  # parts of a token; Lyrical's buffer-aware subscribers append one more


class RosType(NamedTuple):
    """A type of ROS 2 with the hash of its definition, which is part of every key."""

    name: str  # sensor_msgs/msg/JointState
    hash: str  # RIHS01_...

    @property
    def on_wire(self) -> str:
        """As keys and tokens have it: `sensor_msgs::msg::dds_::JointState_`."""
        package, kind, name = self.name.split("/")
        return f"{package}::{kind}::dds_::{name}_"


class EntityKind(StrEnum):
    """What a token of an endpoint stands for."""

    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVER = "SS"
    CLIENT = "SC"


class Qos(NamedTuple):
    """The quality of service of an endpoint that is reliable and keeps its last messages."""

    depth: int = 10
    is_latched: bool = False  # TRANSIENT_LOCAL: a late joiner gets what is kept

    def __str__(self) -> str:
        """All six fields, those equal to the default empty: a wrong one floods the consoles of others."""
        return f":{1 if self.is_latched else ''}:,{self.depth}:,:,:,,"


DEFAULT, LATCHED, FRAMES = Qos(), Qos(1, True), Qos(100)


class NodeName(NamedTuple):
    """A node of ROS 2 on a domain; `namespace` without the slash before it, empty for none."""

    name: str
    namespace: str = ""
    domain: int = 0

    def full(self, name: str) -> str:
        """The name of something with a slash before it: an absolute one as it is, `~/x` below the node's own."""
        if name.startswith("/"):
            return name
        below = "/".join(filter(None, (self.namespace, self.name))) if name.startswith("~/") else self.namespace
        return "/" + "/".join(filter(None, (below, name.removeprefix("~/"))))


def data_key(domain: int, name: str, kind: RosType) -> str:
    """The key of a topic or a service with that full name."""
    return f"{domain}/{name.strip('/')}/{kind.on_wire}/{kind.hash}"


def node_token(node: NodeName, session: str) -> str:
    """`session` is the Zenoh id of the node's session."""
    return f"{TOKENS}/{node.domain}/{session}/0/0/{NODE}/{_owner(node)}"


def endpoint_token(
    node: NodeName, session: str, number: int, entity: EntityKind, name: str, kind: RosType, qos: Qos
) -> str:
    """The token of the node's endpoint `number`, from 1, with the full name `name`."""
    whose = f"{TOKENS}/{node.domain}/{session}/0/{number}/{entity}/{_owner(node)}"
    return f"{whose}/{mangled(name)}/{kind.on_wire}/{kind.hash}/{qos}"


def _owner(node: NodeName) -> str:
    """Enclave, namespace and name."""
    return f"%/{mangled(node.namespace and '/' + node.namespace)}/{node.name}"


def mangled(part: str) -> str:
    return part.replace("/", "%") or "%"


class Entity(NamedTuple):
    """What a token says; of a node only the first four are there."""

    session: str
    kind: str  # of EntityKind, or NODE
    node: str  # its full name
    domain: int
    name: str = ""  # of the topic or service, with a slash before it
    type: str = ""  # as on the wire
    hash: str = ""


def read_token(key: str) -> Entity | None:
    """What a token says, also one with parts behind those that are known; None for what is no token of ROS 2."""
    parts = key.split("/")
    if len(parts) < LEAST_NODE or parts[0] != TOKENS or not parts[1].isdigit():
        return None
    session, kind, namespace, node = parts[2], parts[5], parts[7].replace("%", "/"), parts[8]
    about = Entity(session, kind, f"{namespace.rstrip('/')}/{node}", int(parts[1]))
    if kind == NODE:
        return about
    if len(parts) < LEAST_ENDPOINT:
        return None
    return about._replace(name=parts[9].replace("%", "/"), type=parts[10], hash=parts[11])


def gid_of(token: str) -> bytes:
    """The GID of the endpoint with that token: XXH3-128, the low half first."""
    import xxhash  # of the extra `ros`; what only reads tokens does without

    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(GID, "little")


class Attachment(NamedTuple):
    """What goes with every message, request and reply; a malformed one ends a node of rmw_zenoh_cpp."""

    sequence: int  # from 1
    stamp: int  # [ns] UNIX time of the source
    gid: bytes  # of the endpoint that sends, or in a reply of the client

    def packed(self) -> bytes:
        return ATTACHMENT.pack(self.sequence, self.stamp, GID, self.gid)


def read_attachment(data: bytes) -> Attachment | None:
    """None for one that is not of this form."""
    if len(data) != ATTACHMENT.size:
        return None
    sequence, stamp, length, gid = ATTACHMENT.unpack(data)
    return Attachment(sequence, stamp, gid) if length == GID else None
