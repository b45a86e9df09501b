"""Starting a daemon in the background."""

import io
from unittest import mock

import pytest

from pzctl.daemon.server import launch


def test_ctrl_c_before_it_answers_leaves_no_daemon_behind(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    process = mock.Mock(stdin=io.BytesIO())
    monkeypatch.setattr(launch.subprocess, "Popen", mock.Mock(return_value=process))
    monkeypatch.setattr(launch, "_answering", mock.Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        launch.start()
    process.terminate.assert_called_once()
