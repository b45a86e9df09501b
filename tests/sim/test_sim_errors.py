"""Error sentences of the simulated bench for impossible commands and ports."""

import math
import socket
import sys
import threading

import pytest

from pzctl.sim.bench.bench import BenchError
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimError, SimOptions, running


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (
            {"command": "jig", "wire": 1.0},
            "bench: a jig has no 'wire'; it has resistance, inductance, capacitance, conductance",
        ),
        (
            {"command": "jig", "name": "spoon"},
            "bench: no jig 'spoon'; there are compensated, coax, clips, ideal",
        ),
        ({"command": "jig", "inductance": "long"}, "bench: 'inductance' is 'long'; a number is needed"),
        (
            {"command": "trigger"},
            "bench: no sweep waits for an external or manual trigger; TRGS EXT and SING come first",
        ),
        ({"command": "effects", "noise": 1}, "bench: 'noise' is 1; true or false is needed"),
        (
            {"command": "effects", "self": 1},
            "bench: no effect 'self'; there are drift_K_per_s, start_K, lag_s, strain_softening",
        ),
        ({"command": "effects", "lag_s": 10**400}, f"bench: lag_s is 1{56 * '0'}...; a number is needed"),
        ({"command": "power-cycle", "seconds": 10**400}, f"bench: 'seconds' is 1{56 * '0'}...; a number is needed"),
        ({"command": "power-cycle", "seconds": math.inf}, "bench: 'seconds' is inf; a number is needed"),
        (
            {"command": "hidden", "sweep-lag": 10**400},
            f"bench: sweep-lag is 1{56 * '0'}...; a number from 0 on is needed, in s",
        ),
        ({"command": "connect", "what": "water"}, "bench: cannot connect 'water'; there are device, open, short, load"),
    ],
)
def test_a_command_that_cannot_be(lab, command: dict, says: str) -> None:
    with pytest.raises(BenchError) as caught:
        bench_command("127.0.0.1", lab.sim.bench_port, **command)
    assert str(caught.value) == says


def test_another_program_on_the_bench_s_port() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]

    def answer() -> None:
        for words in (b"", b"220 welcome\n"):
            line, _ = server.accept()
            with line:
                line.recv(100)
                line.sendall(words)

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    with server:
        for says in ("the connection was closed without an answer", "the answer b'220 welcome"):
            with pytest.raises(BenchError, match=says):
                bench_command("127.0.0.1", port, command="status")
        thread.join(5)


def test_an_ftp_port_that_is_taken() -> None:
    pytest.importorskip("aioftp")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(SimError, match=f"cannot listen on 127.0.0.1:{port} .*choose another port, or 0"),
            running(SimOptions(port=0, bench_port=0, ftp_port=port)),
        ):
            pass


def test_ftp_without_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aioftp", None)  # as if it were not installed
    with (
        pytest.raises(SimError, match=r"the FTP server needs aioftp: pip install aioftp"),
        running(SimOptions(port=0, bench_port=0, ftp_port=0)),
    ):
        pass
