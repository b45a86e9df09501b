"""A C program and a Node program receive a sweep: its numbers equal the recording's bit for bit.

C needs a compiler, libzmq and cJSON with their headers (Debian: libzmq3-dev libcjson-dev). Node needs the package
`zeromq` from npm, where NODE_PATH finds it, or is given it by npm install into a folder of the test: from npm's own
cache, if it was loaded once.
"""

import os
import re
import shutil
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest

from pzctl import connect
from pzctl.daemon.files.paths import daemon_file, home
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="session")
def c_subscriber(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler `cc`")
    program = tmp_path_factory.mktemp("c") / "subscriber"
    words = [compiler, "-Wall", "-Wextra", "-Werror", "-o", program, EXAMPLES / "subscriber.c", "-lzmq", "-lcjson"]
    built = subprocess.run(words, capture_output=True, text=True, check=False)
    if built.returncode:
        if not re.search(r"(zmq|cJSON)\.h: No such file|cannot find -l(zmq|cjson)", built.stderr):
            pytest.fail(built.stderr)
        pytest.skip("libzmq or cJSON is not installed (Debian: libzmq3-dev libcjson-dev)")
    return [str(program)]


@pytest.fixture(scope="session")
def node_subscriber(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("there is no Node, or no npm")
    folder = tmp_path_factory.mktemp("node")
    shutil.copy(EXAMPLES / "subscriber.js", folder)
    if not _has_zeromq(node, folder):
        words = [npm, "install", "--prefer-offline", "--no-audit", "--no-fund", "--prefix", folder, "zeromq@6"]
        try:
            subprocess.run(words, capture_output=True, timeout=90, check=False, cwd=folder)
        except subprocess.TimeoutExpired:
            pytest.skip("npm took too long to install zeromq")
    if not _has_zeromq(node, folder):
        pytest.skip("npm cannot install zeromq here")
    return [node, str(folder / "subscriber.js")]


def _has_zeromq(node: str, folder: Path) -> bool:
    return (
        subprocess.run([node, "-e", "require('zeromq')"], cwd=folder, capture_output=True, check=False).returncode == 0
    )


@pytest.mark.parametrize("language", ["c_subscriber", "node_subscriber"])
def test_the_same_numbers(start_daemon, build: Build, language: str, request: pytest.FixtureRequest) -> None:
    words: list[str] = request.getfixturevalue(language)
    start_daemon()
    program = subprocess.Popen(
        [*words, str(daemon_file(home()))],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
    stop = threading.Timer(60, program.kill)
    stop.start()
    try:
        assert program.stderr is not None
        assert program.stderr.readline() == "listening\n"
        with connect() as lab:
            sweep: Sweep = lab.measure(build, "disk").sweeps[0]
        out, errors = program.communicate()
    finally:
        stop.cancel()
        program.kill()
    assert program.returncode == 0, errors
    heard = np.array([[float(word) for word in line.split()] for line in out.splitlines()])
    assert np.array_equal(heard[:, 0], sweep.frequency)
    assert np.array_equal(heard[:, 1] + 1j * heard[:, 2], sweep.impedance)
