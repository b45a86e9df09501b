"""The page as an interface for programs: measured and read by plain HTTP, with every route in its document."""

import json
import re
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from chromium import free_port
from page_requests import ask

from pzctl.drivers.recordings import read_recording

TOKEN = "at least sixteen characters"  # noqa: S105
GUIDE = Path(__file__).parents[3] / "docs" / "http-api.md"


class Http:
    """A page that programs use, with its token unless another is given."""

    def __init__(self, port: int) -> None:
        self.address = f"http://127.0.0.1:{port}"

    def __call__(self, path: str, body: object = None, token: str = TOKEN) -> bytes:
        data = None if body is None else json.dumps(body).encode()
        asked = Request(f"{self.address}{path}", data, {"Authorization": f"Bearer {token}"})  # noqa: S310
        with urlopen(asked, timeout=60) as answer:  # noqa: S310
            return answer.read()


@pytest.fixture
def http(start_daemon, wait_until) -> Iterator[Http]:
    """The page of a running daemon."""
    start_daemon(names=("mason",))
    port = free_port()
    words = ["page", "--port", str(port), "--token", TOKEN, "--json"]
    page = subprocess.Popen([Path(sys.executable).with_name("pzctl"), *words], stdout=subprocess.PIPE, text=True)

    def serves() -> bool:
        with socket.socket() as link:
            return link.connect_ex(("127.0.0.1", port)) == 0

    wait_until(serves)

    yield Http(port)
    page.terminate()
    page.communicate(timeout=60)


def test_a_program_measures_and_reads_the_sweep_and_the_constants(
    http: Http, wait_until: Callable[[Callable[[], object]], None], tmp_path: Path
) -> None:
    started = json.loads(http("/api/measure", {"step": "disk", "metadata": {"batch": "B7"}}))["measurement"]

    def step() -> dict[str, Any]:
        (found,) = json.loads(http(f"/api/record/{started}"))["steps"]
        return found

    wait_until(lambda: step()["fits"])
    assert step()["metadata"]["batch"] == "B7"
    (fitted,) = step()["fits"]
    assert fitted["constants"]["disk.c33D"]["re"] > 1e11
    (tmp_path / "disk.csv").write_bytes(http(f"/download/{started}/1.csv"))
    assert read_recording(tmp_path / "disk.csv").frequency.size > 100
    (sample,) = json.loads(http("/api/history"))["samples"]
    assert sample["steps"][0]["step"] == "disk"
    for asked, status, says in (
        ({"body": {"step": "ml9"}}, 409, b"build 'thesis' has no step 'ml9'; it has disk, ml1, ml2"),
        ({"body": {"stop": "disk"}}, 400, b"unknown field `stop`"),
        ({"body": {"step": "disk"}, "token": "of another page"}, 401, b"needs a token"),
    ):
        with pytest.raises(HTTPError) as refused:
            http("/api/measure", **asked)
        with refused.value as answer:
            assert (answer.code, says in answer.read()) == (status, True)


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="there is no Octave here")
def test_the_program_of_the_guide_measures_from_octave(http: Http, tmp_path: Path) -> None:
    (program,) = re.findall(r"```matlab\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    script = tmp_path / "bench.m"
    program = program.replace("http://127.0.0.1:8294", http.address)
    script.write_text(program + "disp(size(sweep, 2) > 1000);\n", encoding="utf-8")
    ran = subprocess.run(["octave-cli", script], capture_output=True, text=True, check=False)
    assert ran.stdout.split() == ["mason", "1"], ran.stderr


def test_a_command_needs_its_token_in_the_header_or_comes_from_the_page() -> None:
    bearer = f"Bearer {TOKEN}"
    assert ask("/api/cancel", TOKEN, "POST", authorization=bearer)[0] == 409, "accepted: no daemon runs"
    status, _, body = ask("/api/cancel", TOKEN, "POST", cookie="pzctl-token=" + TOKEN, origin="http://evil.example")
    assert (status, b"Authorization: Bearer" in body) == (403, True), "a browser sends a cookie for any site"
    assert ask("/api/cancel", None, "POST", authorization=bearer)[0] == 403, "without tokens only the page commands"


def test_every_route_is_in_the_document_and_every_path_of_the_guide() -> None:
    document = json.loads(ask("/api/openapi.json")[2])
    assert document["openapi"].startswith("3.1")
    paths = document["paths"]
    for path, operations in paths.items():
        for operation in operations.values():
            assert operation["summary"].endswith("."), path
            assert {one["name"] for one in operation["parameters"]} == set(re.findall(r"{(\w+)}", path))
    known = document["components"]["schemas"]
    for name in re.findall(r'"#/components/schemas/(\w+)"', json.dumps(document)):
        assert name in known
    assert paths["/api/measure"]["post"]["requestBody"]["content"]["application/json"]["schema"]
    for path in re.findall(r"\$page(/[\w/.]+)", GUIDE.read_text(encoding="utf-8")):
        patterns = [re.sub(r"{\w+}", "[^/]+", one) for one in paths]
        assert any(re.fullmatch(pattern, path) for pattern in patterns), path
