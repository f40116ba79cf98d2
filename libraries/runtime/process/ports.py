"""Port checks: refuses a port that another process listens on, and names that process."""

from __future__ import annotations

import errno
import socket
from pathlib import Path


class PortTaken(Exception):
    """A port that something else listens on, or that may not be listened on; one sentence with the remedy."""


def require_free(host: str, port: int, section: str, key: str = "port") -> None:
    """Returns if `host`:`port` can be listened on; else raises `PortTaken` with the key of the deployment to change."""
    variable = f"GEMELO_{section}_{key}".upper()
    remedy = f"stop that, or set {variable} or [{section}] {key} in the deployment file to another"
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
            probe.listen(1)
        except (OSError, OverflowError) as error:
            if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
                raise PortTaken(f"port {port} on {host} is taken{_holder(port)}: {remedy}") from None
            raise PortTaken(f"cannot listen on {host} port {port} ({error}): {remedy}") from None


def _holder(port: int) -> str:
    """`" by mosquitto (pid 7), which runs in /home/ana/arm"`, or nothing where the system does not tell.

    A twin that was started in another folder and forgotten ends with `make down` there.
    """
    import psutil  # 20 ms that only a taken port is worth

    try:
        for connection in psutil.net_connections("tcp"):
            if connection.status == psutil.CONN_LISTEN and connection.laddr.port == port and connection.pid:
                holder = psutil.Process(connection.pid)
                where = holder.cwd()
                forgotten = " (a twin of that folder ends with `make down` there)" if Path(where) != Path.cwd() else ""
                return f" by {holder.name()} (pid {connection.pid}), which runs in {where}{forgotten}"
    except psutil.Error:
        pass
    return ""
