"""The meshes of the robot's description over HTTP, as STL: RViz resolves no relative address, and reads glTF by luck.

Only this machine reaches the port, and only what the description names is served.
"""

from __future__ import annotations

import threading
from functools import cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path, PurePosixPath

from gemelo.libraries.ros2.messages import relative_meshes

HOST = "127.0.0.1"
STL = ".stl"


class MeshServer:
    """Serves until it is closed."""

    def __init__(self, urdf: str, folder: Path) -> None:
        """The relative addresses of meshes in `urdf` are of files below `folder`."""
        files = {served_as(each): folder / each for each in relative_meshes(urdf)}
        self._server = ThreadingHTTPServer((HOST, 0), _handler(files))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True, name="meshes")
        self._thread.start()

    @property
    def base(self) -> str:
        """What stands before the address of each mesh."""
        return f"http://{HOST}:{self._server.server_address[1]}"

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def served_as(address: str) -> str:
    """The path of a mesh with a relative address: what is no STL becomes one."""
    return str(PurePosixPath(address).with_suffix(STL))


def _handler(files: dict[str, Path]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            path = files.get(self.path.removeprefix("/"))
            try:
                content = stl_of(path) if path is not None else None
            except (OSError, ValueError):
                content = None
            if content is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", "model/stl")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *_: object) -> None:
            """Nothing: each start of RViz asks for every mesh."""

    return Handler


@cache
def stl_of(path: Path) -> bytes:
    """The file as binary STL in its own axes and units; raises OSError, and ValueError for what is no mesh."""
    if path.suffix.lower() == STL:
        return path.read_bytes()
    import trimesh  # slow to load: only where somebody asks for a mesh

    return bytes(trimesh.load(path, force="mesh").export(file_type="stl"))
