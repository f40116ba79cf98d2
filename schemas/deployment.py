"""`deploy/local.toml` and its kin as types: where things run and listen."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from gemelo.schemas.system import ParameterValue


class DeploymentRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a deployment file; an unknown key is an error."""


class Broker(StrEnum):
    """Which MQTT broker gateway and device meet at."""

    EMBEDDED = "embedded"  # the process `broker` becomes gemelo's own, which `make setup` builds
    MOSQUITTO = "mosquitto"  # the process `broker` becomes it
    EXTERNAL = "external"  # one that runs already; the process `broker` stands aside


class DeviceKind(StrEnum):
    """The kind of device that drives the arm."""

    VIRTUAL = "virtual"  # the process virtual_esp32
    BOARD = "board"  # a real ESP32; virtual_esp32 stands aside


class Wire(StrEnum):
    """The link between gateway and device."""

    MQTT = "mqtt"
    SERIAL = "serial"


class ViewerMode(StrEnum):
    """The way the Rerun viewer is shown."""

    AUTO = "auto"  # native where there is a display, else web
    NATIVE = "native"
    WEB = "web"
    NONE = "none"  # only the recording


class RouterSection(DeploymentRecord, frozen=True, kw_only=True):
    """With TLS both ends show a certificate, and the common name of a node's is its role (schemas/roles.py)."""

    host: str = "127.0.0.1"  # that nodes connect to
    port: int = 7447
    listen_host: str = ""  # that the process `router` listens on; empty: host
    listen_port: int = 0  # the same; 0: port
    configuration: str = ""  # json5 of `gemelo deploy render`: addresses, TLS and permissions; empty: open
    tls: bool = False
    ca: str = ""  # PEM file of the authority that signed the certificates of router and nodes
    certificate: str = ""  # PEM file of this node's own
    key: str = ""  # its private key, of mode 600
    insecure: bool = False  # may listen beyond loopback without TLS

    @property
    def listening(self) -> tuple[str, int]:
        """Host and port that our own router listens on."""
        return self.listen_host or self.host, self.listen_port or self.port


class MqttSection(DeploymentRecord, frozen=True, kw_only=True):
    """Passwords are in files of mode 600, or in $GEMELO_MQTT_PASSWORD and $GEMELO_MQTT_DEVICE_PASSWORD."""

    broker: Broker = Broker.EMBEDDED
    host: str = "127.0.0.1"  # that gateway and virtual device connect to
    port: int = 1883
    listen_host: str = ""  # that the process `broker` listens on; empty: host
    listen_port: int = 0  # the same; 0: port
    secure_folder: str = ""  # that `gemelo broker secure` has written: TLS, users and passwords of every end
    persistence_folder: str = ""  # where our own broker keeps sessions and retained messages; empty: keeps none
    user: str = ""  # of the gateway; empty: none
    password_file: str = ""
    device_user: str = ""  # of the virtual device; empty: the gateway's. A board is provisioned with its own
    device_password_file: str = ""
    tls: bool = False
    ca: str = ""  # PEM file of the authority that signed the broker's certificate; empty: those of this system
    certificate: str = ""  # PEM file of our own, where the broker asks for one
    key: str = ""  # its private key, of mode 600; empty: in the same file
    insecure: bool = False  # may listen beyond loopback without TLS

    @property
    def listening(self) -> tuple[str, int]:
        """Host and port that our own broker listens on."""
        return self.listen_host or self.host, self.listen_port or self.port


class SerialSection(DeploymentRecord, frozen=True, kw_only=True):
    device: str = "/dev/ttyUSB0"
    baud: int = 0  # 0: [device] serial_baud of robot.toml


class ViewerSection(DeploymentRecord, frozen=True, kw_only=True):
    mode: ViewerMode = ViewerMode.AUTO
    host: str = "127.0.0.1"
    port: int = 9876  # gRPC
    web_port: int = 9090  # the page
    language: str = ""  # of the view, as "es"; empty: that of the locale of the process
    insecure: bool = False  # may listen beyond loopback: it has no TLS


class PanelSection(DeploymentRecord, frozen=True, kw_only=True):
    host: str = "127.0.0.1"
    port: int = 8088  # the operator's page
    name: str = ""  # by which other machines open it and the view; addresses and the host's own name count besides
    insecure: bool = False  # may listen beyond loopback: it has no TLS


class RosMeshes(StrEnum):
    """Where RViz finds the meshes of the robot's description."""

    NONE = "none"  # the description is as the arm's own file has it
    FILE = "file"  # on this host, as they are
    HTTP = "http"  # from the bridge, on loopback, as STL


class RosSection(DeploymentRecord, frozen=True, kw_only=True):
    """The arm as a node of ROS 2; the process `ros_bridge` is started by hand (docs/from_ros2.md)."""

    router: str = ""  # of ROS, rmw_zenohd, as "tcp/127.0.0.1:7448"; it has no default, as 7447 is our own router's
    domain: int = 0  # ROS_DOMAIN_ID
    namespace: str = ""  # of all names, and before every frame; each of several arms on one domain needs its own
    node: str = "gemelo"
    controller: str = "arm_controller"  # the action is <controller>/follow_joint_trajectory
    motion: bool = False  # whoever reaches the ROS router may move the arm
    meshes: RosMeshes = RosMeshes.HTTP
    rate: float = 0.0  # [Hz] of joint states and frames at most; 0: each of them


class PathsSection(DeploymentRecord, frozen=True, kw_only=True):
    run: str = ".gemelo/run"  # readiness files, the virtual device's memory
    out: str = "out"  # recordings and logs
    programs: str = "programs"  # taught points and programs


class Deployment(DeploymentRecord, frozen=True, kw_only=True):
    """One deployment; every key can be overridden by GEMELO_<SECTION>_<KEY> in the environment."""

    robot: str = "urdf/rm1"
    cell: str = ""  # cell.toml: cameras, things and places around the arm; empty: none
    arms: str = ""  # folder with a deployment for each arm that shares this one's viewer; empty: it has one of its own
    router: RouterSection = RouterSection()
    device: DeviceKind = DeviceKind.VIRTUAL
    wire: Wire = Wire.MQTT  # how the gateway reaches the device
    mqtt: MqttSection = MqttSection()
    serial: SerialSection = SerialSection()
    viewer: ViewerSection = ViewerSection()
    panel: PanelSection = PanelSection()
    ros: RosSection = RosSection()
    paths: PathsSection = PathsSection()
    parameters: dict[str, dict[str, ParameterValue]] = {}  # by node, then by name
