"""The folder of clients' keys while it cannot be listed."""

import logging
from pathlib import Path

import pytest

from pzctl.daemon.server.access.key_folder import KeyFolder
from pzctl.daemon.wire.curve_keys import make_client, make_server


def test_clients_stay_as_they_are_while_their_folder_cannot_be_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    make_server(tmp_path)
    key = make_client(tmp_path, "ana", "measure")
    folder = KeyFolder(tmp_path)
    assert list(folder.clients()) == [key.public]

    def no_more_files(_self: Path, _pattern: str) -> list[Path]:
        raise OSError(24, "Too many open files")

    with monkeypatch.context() as patched, caplog.at_level(logging.WARNING):
        patched.setattr(Path, "glob", no_more_files)
        assert [list(folder.clients()) for _ in range(2)] == [[key.public]] * 2
    assert [one.message for one in caplog.records] == ["the clients stay as they are: [Errno 24] Too many open files"]
    assert list(folder.clients()) == [key.public]
