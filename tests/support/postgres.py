"""A PostgreSQL server for the tests, in a temporary folder, reached by a socket in it."""

import os
import pwd
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def programs() -> Path | None:
    """Return the folder of initdb and pg_ctl, which Debian does not put on the path."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((folder for folder in folders if (folder / "pg_ctl").exists()), None)


def reason_why_not() -> str:
    """Return why no server can be started here; an empty text if one can."""
    if programs() is None:
        return "no PostgreSQL server is installed (Debian: postgresql)"
    if os.geteuid() == 0:
        try:
            pwd.getpwnam("postgres")
        except KeyError:
            return "PostgreSQL refuses to run as root, and there is no user postgres"
    return ""


class Server:
    """A server in a folder, with a database called `record`."""

    def __init__(self, folder: Path) -> None:
        self.url = f"postgresql://pzctl:secret@/record?host={folder}"
        self._folder = folder
        self._who: dict[str, Any] = {}
        if os.geteuid() == 0:
            user = pwd.getpwnam("postgres")
            os.chown(folder, user.pw_uid, user.pw_gid)
            self._who = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
        (folder / "said").touch()

    def make(self) -> None:
        """Create its files and the database, and start it."""
        self._run("initdb", *self._data, "-U", "pzctl", "-A", "trust", "--no-sync", "--no-locale", "-E", "UTF8")
        settings = self._folder / "data" / "postgresql.conf"
        if sys.platform == "linux" and "recovery_init_sync_method" in settings.read_text(encoding="utf-8"):
            with settings.open("a", encoding="utf-8") as file:  # after a kill, syncing each file would take 5 s
                file.write("recovery_init_sync_method = syncfs\n")
        self.start()
        self._run("createdb", "-h", str(self._folder), "-U", "pzctl", "record")

    def start(self) -> None:
        """Start it, unless it runs."""
        if not (self._folder / "data" / "postmaster.pid").exists():
            options = f"-k {self._folder} -c listen_addresses="
            self._run("pg_ctl", *self._data, "-w", "-l", str(self._folder / "log"), "-o", options, "start")

    def stop(self) -> None:
        """End it at once, as a kill would."""
        self._run("pg_ctl", *self._data, "-m", "immediate", "stop")
        (self._folder / "data" / "postmaster.pid").unlink(missing_ok=True)

    @property
    def _data(self) -> tuple[str, str]:
        return ("-D", str(self._folder / "data"))

    def _run(self, program: str, *words: str) -> None:
        programs_here = programs()
        assert programs_here is not None
        with (self._folder / "said").open("ab") as said:
            command = [programs_here / program, *words]
            subprocess.run(command, cwd=self._folder, stdout=said, stderr=said, check=True, **self._who)


@contextmanager
def running() -> Generator[Server]:
    """Give a server that is ended with this context."""
    folder = Path(tempfile.mkdtemp(prefix="pzctl-pg-", dir="/tmp"))
    try:
        server = Server(folder)
        server.make()
        try:
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder)
