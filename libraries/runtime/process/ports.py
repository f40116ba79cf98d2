"""Port checks: refuses a port that another process listens on, and names that process."""

from __future__ import annotations

import errno
import socket
from pathlib import Path

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, Remedy, because, remedy


class PortTaken(ReasonedError):
    """A port that something else listens on, or that may not be listened on."""


def require_free(host: str, port: int, section: str, key: str = "port") -> None:
    """Returns if `host`:`port` can be listened on; else raises `PortTaken` with the key of the deployment to change."""
    other = remedy("other_port", variable=f"GEMELO_{section}_{key}".upper(), section=section, key=key)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
            probe.listen(1)
        except (OSError, OverflowError) as error:
            if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
                raise PortTaken(_taken(host, port, other)) from None
            raise PortTaken(because("port.refused", other, host=host, port=port, error=str(error))) from None


def _taken(host: str, port: int, other: Remedy) -> Reason:
    """With the process that has it, where the system says which.

    A twin that was started in another folder and forgotten ends with `make down` there.
    """
    import psutil  # 20 ms that only a taken port is worth

    try:
        for connection in psutil.net_connections("tcp"):
            if connection.status == psutil.CONN_LISTEN and connection.laddr.port == port and connection.pid:
                holder = psutil.Process(connection.pid)
                where, name, pid = holder.cwd(), holder.name(), connection.pid
                code = "port.taken.here" if Path(where) == Path.cwd() else "port.taken.elsewhere"
                return because(code, other, host=host, port=port, name=name, process=pid, folder=where)
    except psutil.Error:
        pass
    return because("port.taken", other, host=host, port=port)
