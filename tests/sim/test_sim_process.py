"""The simulator as a process: it prints its addresses, ends on a signal, and refuses to start in one sentence."""

import gc
import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimError, SimOptions, running

SCRIPT = "from pzctl.sim.server import SimOptions, run; run(SimOptions(port=0, bench_port=0, prologix_port=0))"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_prints_its_addresses_and_ends_cleanly(number, tmp_path, start_program):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = start_program([sys.executable, "-c", SCRIPT], cwd=tmp_path, **pipes)
    addresses = json.loads(process.stdout.readline())
    host, port = addresses["bench"].split(":")
    assert bench_command(host, int(port), command="status")["step"] == "disk"
    assert addresses["instrument"].startswith("TCPIP0::127.0.0.1::")
    assert addresses["prologix"].startswith("PRLGX-TCPIP0::127.0.0.1::")
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert out == ""
    (line,) = err.splitlines()
    assert addresses["instrument"] in line
    assert addresses["bench"] in line


def test_quiet_prints_the_addresses_for_programs_only(tmp_path, start_program):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    words = [Path(sys.executable).with_name("pzctl"), "sim", "--quiet", "--port", "0", "--bench-port", "0"]
    process = start_program(words, cwd=tmp_path, **pipes)
    assert "instrument" in json.loads(process.stdout.readline())
    process.terminate()
    assert process.communicate(timeout=120) == ("", "")


def test_stopping_closes_even_new_connections():
    for _ in range(20):
        with running() as sim:
            clients = [socket.create_connection(("127.0.0.1", sim.port)) for _ in range(3)]
        for client in clients:
            client.close()
    gc.collect()  # a socket left open raises a warning here, and warnings are errors


def test_a_port_that_is_taken_is_one_sentence():
    with running() as first, pytest.raises(SimError, match=rf"cannot listen on 127.0.0.1:{first.port}"):
        running(SimOptions(port=first.port, bench_port=0)).__enter__()


@pytest.mark.parametrize("wrong", [{"port": 70000}, {"time_scale": -1.0}, {"seed": -1}, {"jig": "glove"}])
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(SimError, match="simulator: "):
        SimOptions(**wrong)
