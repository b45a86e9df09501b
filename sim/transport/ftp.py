"""The instrument's FTP server: without login, with files that are generated when they are fetched (PM p.167).

`/data` has the files generated on request: the screen, the state, the data traces. `/int`, `/ram` and `/nvram` have
the files saved on the floppy, the RAM disk and the flash disk (PM p.167-171). Clients cannot write.

The server is aioftp, which runs on asyncio as the simulator does.
"""

import io
from collections.abc import Callable, Mapping
from pathlib import PurePath
from typing import Any

from ..instrument.instrument import Instrument
from ..language.file_commands import WRITERS
from ..language.messages import CommandError
from .listener import SimError

FOLDERS = {"int": "DISK", "ram": "MEMO", "nvram": "FLASH"}
"""Storage devices by folder name."""

GENERATED = {"state.sta": ".STA", "screen.tif": ".TIF", "data_dt.dat": ".DAT", "data_dt.txt": ".TXT"}
"""Files generated on request in `/data`; a real instrument also has calibration, data and memory arrays."""

Content = Callable[[], bytes]


def tree(instrument: Instrument) -> Mapping[str, Mapping[str, Content]]:
    """Return the files that a client sees: their content by folder and name."""

    def generated(kind: str) -> Content:
        return lambda: WRITERS[kind](instrument)

    def stored(device: str, name: str) -> Content:
        return lambda: instrument.disk.content(device, name)

    saved = {
        folder: {name: stored(device, name) for name in instrument.disk.names(device) if not name.endswith("\\")}
        for folder, device in FOLDERS.items()
    }
    return {"data": {name: generated(kind) for name, kind in GENERATED.items()}} | saved


class FtpServer:
    """The running server. One event loop at a time."""

    def __init__(self, instrument: Instrument) -> None:
        try:
            import aioftp
            from aioftp.pathio import MemoryPathIO, Node
        except ImportError:
            raise SimError("simulator: the FTP server needs aioftp: pip install aioftp") from None

        class Files(MemoryPathIO):
            """The files of the instrument; aioftp addresses every file by its node."""

            def get_node(self, path: PurePath) -> Node | None:
                instrument.advance()
                return _node(tree(instrument), path.parts[1:], Node)

        nobody = aioftp.User(base_path="/", permissions=[aioftp.Permission("/", writable=False)])
        factory: Any = Files
        self._server = aioftp.Server([nobody], path_io_factory=factory, welcome_message="4294A FTP server")

    async def start(self, host: str, port: int) -> int:
        """Listen; return the port. Raises SimError where it is taken."""
        try:
            await self._server.start(host, port)
        except OSError as error:
            says = f"simulator: cannot listen on {host}:{port} ({error.strerror})"
            raise SimError(f"{says}; choose another port, or 0 for any free one") from error
        server: Any = self._server
        return int(server.server_port)

    async def stop(self) -> None:
        """Stop listening and cut every client off."""
        await self._server.close()


def _node(files: Mapping[str, Mapping[str, Content]], parts: tuple[str, ...], make: Any) -> Any:
    """Return the node of a file or folder for aioftp, created by `make`; None if there is none."""
    if not parts:
        return make("dir", "/", content=[make("dir", folder, content=[]) for folder in files])
    folder, names = files.get(parts[0], {}), parts[1:]
    if parts[0] in files and not names:
        return make("dir", parts[0], content=[make("file", name, content=io.BytesIO()) for name in folder])
    name = "/".join(names)
    if name not in folder:
        return None
    try:
        return make("file", name, content=io.BytesIO(folder[name]()))
    except CommandError:  # as at the front panel: these data cannot be saved in this format, so there is no file
        return None
