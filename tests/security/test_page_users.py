"""The page's users: who may read, who may act, and under which name; and HTTPS with the lab's own certificate."""

import asyncio
import datetime
import json
import os
import re
import socket
import ssl
import threading
import urllib.request
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from page_requests import BUILD, ask

from pzctl.daemon.client.conversations import Conversations
from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.page import page_client
from pzctl.daemon.page.page_process import PageError, tls_context
from pzctl.daemon.page.page_server import STATIC, page_app
from pzctl.daemon.page.page_users import PageUsers, PageUsersError, add_user
from pzctl.daemon.page.timed_protocol import encrypted_protocol
from pzctl.daemon.wire.replies import Answer
from pzctl.daemon.wire.requests import Request

FROM_PAGE = {"host": "lab:8294", "origin": "http://lab:8294"}


@pytest.fixture(autouse=True)
def _home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "page-users.toml"


def test_who_may_read_sees_everything_and_commands_nothing(file: Path) -> None:
    reads, acts = add_user(file, "eva", "read"), add_user(file, "ana", "act")
    users = PageUsers(file)
    for token, name in ((reads, "eva"), (acts, "ana")):
        status, _, body = ask("/api/now", users=users, host="lab:8294", cookie=f"pzctl-token={token}")
        assert (status, json.loads(body)["user"]["name"]) == (200, name)
    for path in ("measure", "cancel", "diagnose", "look", "fit", "keep"):
        status, _, body = ask(f"/api/{path}", users=users, method="POST", cookie=f"pzctl-token={reads}", **FROM_PAGE)
        assert (status, json.loads(body)["error"]) == (403, "eva has the right to read only, so commands are refused")
    status, _, body = ask("/api/cancel", users=users, method="POST", cookie=f"pzctl-token={acts}", **FROM_PAGE)
    assert (status, b"no daemon runs" in body) == (409, True), "let through"


def test_without_a_token_of_the_file_nobody_comes_in_even_on_this_machine(file: Path) -> None:
    add_user(file, "ana", "act")
    users = PageUsers(file)
    assert ask("/", users=users)[0] == 401
    assert ask("/", users=users, cookie="pzctl-token=guessed")[0] == 401
    assert ask("/?token=guessed", users=users)[0] == 401


def test_the_file_holds_no_token_and_is_the_owners(file: Path) -> None:
    token = add_user(file, "ana", "act")
    assert token not in file.read_text()
    if os.name == "posix":
        assert file.stat().st_mode & 0o077 == 0


def test_who_is_removed_is_out_at_once_and_a_file_that_broke_lets_nobody_in(file: Path) -> None:
    token = add_user(file, "ana", "act")
    users = PageUsers(file)
    file.write_text("")
    assert users.of_token(token) is None
    other = add_user(file, "eva", "read")
    assert users.of_token(other) is not None
    file.write_text("[eva]\nright = 'everything'\n")
    assert users.of_token(other) is None


def test_a_removed_user_hears_no_further_event(file: Path) -> None:
    token = add_user(file, "ana", "act")
    heard: list[dict[str, Any]] = []

    async def streamed() -> None:
        app = page_app(parse_build(BUILD), users=PageUsers(file))
        headers = [(b"host", b"lab"), (b"cookie", f"pzctl-token={token}".encode())]
        scope = {"type": "http", "method": "GET", "path": "/api/events", "query_string": b"", "headers": headers}

        async def send(message: Any) -> None:
            heard.append(message)
            if message["type"] == "http.response.body" and message["body"].startswith(b"retry"):
                file.write_text("")

        async with app.router.lifespan_context(app):  # the first event says that no daemon runs
            await asyncio.wait_for(app(scope, asyncio.Event().wait, send), 60)  # type: ignore[arg-type]

    asyncio.run(streamed())
    assert b"".join(message.get("body", b"") for message in heard) == b"retry: 1000\n\n"


@pytest.mark.parametrize(("name", "says"), [("../ana", "a name has"), ("ana", "exists already")])
def test_a_user_that_cannot_be_added_is_refused(file: Path, name: str, says: str) -> None:
    add_user(file, "ana", "act")
    with pytest.raises(PageUsersError, match=says):
        add_user(file, name, "read")


@pytest.mark.parametrize("content", ["[ana", '[ana]\nright = "act"\n', '["a b"]\nright = "act"\ntoken_sha256 = "00"\n'])
def test_an_invalid_file_of_users_is_refused(file: Path, content: str) -> None:
    file.write_text(content)
    with pytest.raises(PageUsersError, match="page-users"):
        PageUsers(file)


@pytest.mark.parametrize("header", ["x-forwarded-for", "forwarded", "via"])
def test_behind_a_proxy_nobody_comes_in_without_a_token(header: str) -> None:
    assert ask("/", **{header: "192.168.0.7"})[0] == 421


def test_behind_the_proxy_of_the_guide_a_user_acts_and_the_cookie_is_secure(file: Path) -> None:
    guide = (Path(page_client.__file__).parents[2] / "docs" / "page.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"proxy_set_header (\S+) (\S+);", guide))
    given = {"$http_host": "lab.example", "$remote_addr": "192.168.0.7", "$scheme": "https"}
    headers = {name.lower(): given[value] for name, value in told.items()}
    token, users = add_user(file, "ana", "act"), PageUsers(file)
    status, answer, _ = ask(f"/?token={token}", users=users, trusts_proxy=True, **headers)
    assert (status, "secure" in answer["set-cookie"].lower()) == (303, True)
    headers |= {"origin": "https://lab.example", "cookie": f"pzctl-token={token}"}
    assert ask("/api/cancel", users=users, method="POST", trusts_proxy=True, **headers)[0] == 409, "let through"


def test_the_name_of_the_user_goes_with_each_request(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Request] = []

    def keep(_: Conversations, request: Request, *_rest: Any) -> Generator[Any, Any, Answer]:
        asked.append(request)
        yield from ()
        return Answer(id=request.id)

    monkeypatch.setattr(page_client, "address", lambda *_: ("tcp://127.0.0.1:1", "tcp://127.0.0.1:2", None))
    monkeypatch.setattr(Conversations, "answer_to", keep)
    with page_client.PageClient("ana") as lab:
        lab.cancel()
    assert [request.by for request in asked] == ["ana"]


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    """A self-signed certificate for 127.0.0.1, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "localhost")])
    now = datetime.datetime.now(datetime.UTC)
    made = x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
    made = made.not_valid_before(now - datetime.timedelta(1)).not_valid_after(now + datetime.timedelta(1))
    made = made.add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
    pem, private = tmp_path / "lab.pem", tmp_path / "lab.key"
    pem.write_bytes(made.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))
    form = (serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    private.write_bytes(key.private_bytes(*form))
    return pem, private


@contextmanager
def https(certificate: tuple[Path, Path], users: PageUsers, most: int | None = None) -> Iterator[tuple[str, int]]:
    """Serve the page as `pzctl page` does with a certificate, in a thread."""
    protocol = encrypted_protocol(tls_context(*certificate))
    app = page_app(parse_build(BUILD), users=users)
    config = uvicorn.Config(app, port=0, http=protocol, log_level="critical", ws="none", limit_concurrency=most)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            assert thread.is_alive()
        yield server.servers[0].sockets[0].getsockname()
    finally:
        server.should_exit = True
        thread.join()


def test_with_a_certificate_the_page_is_served_by_https(certificate: tuple[Path, Path], file: Path) -> None:
    token = add_user(file, "ana", "read")
    with https(certificate, PageUsers(file)) as (_, port):
        trust = ssl.create_default_context(cafile=certificate[0])
        asked = urllib.request.Request(f"https://localhost:{port}/?token={token}")
        opener = urllib.request.build_opener(urllib.request.HTTPSHandler(context=trust), _Stay())
        with opener.open(asked) as answer:
            assert "secure" in answer.headers["set-cookie"].lower(), "the token is never sent unencrypted"


def test_a_request_that_comes_with_the_end_of_the_handshake_is_answered_encrypted(
    certificate: tuple[Path, Path], file: Path
) -> None:
    token = add_user(file, "ana", "read")
    head = ("GET /static/page.css HTTP/1.1", "Host: localhost", f"Authorization: Bearer {token}", "Connection: close")
    trust, come, go = ssl.create_default_context(cafile=certificate[0]), ssl.MemoryBIO(), ssl.MemoryBIO()
    client = trust.wrap_bio(come, go, server_hostname="localhost")
    with https(certificate, PageUsers(file)) as address, socket.create_connection(address, 60) as link:
        while True:
            with suppress(ssl.SSLWantReadError):
                client.do_handshake()
                break
            link.sendall(go.read())
            come.write(link.recv(1 << 16))
        client.write("\r\n".join((*head, "", "")).encode())
        link.sendall(go.read())
        answer = b""
        ended = False
        while not ended:
            come.write(link.recv(1 << 16))
            with suppress(ssl.SSLWantReadError):
                while text := client.read():
                    answer += text
                ended = True
    assert answer.startswith(b"HTTP/1.1 200 OK")
    assert answer.endswith((STATIC / "page.css").read_bytes())


def test_idle_connections_make_room_before_their_handshake(certificate: tuple[Path, Path], file: Path) -> None:
    token = add_user(file, "ana", "read")
    with https(certificate, PageUsers(file), most=4) as address, ExitStack() as kept:
        idle = [kept.enter_context(socket.create_connection(address, 60)) for _ in range(5)]
        assert [link.recv(1) for link in idle[:2]] == [b"", b""], "closed"
        idle[2].sendall(b"GET / HTTP/1.1\r\n\r\n")  # no handshake
        while idle[2].recv(100):
            pass
        trust = ssl.create_default_context(cafile=certificate[0])
        asked = urllib.request.Request(f"https://localhost:{address[1]}/", headers={"Authorization": f"Bearer {token}"})
        with urllib.request.urlopen(asked, context=trust, timeout=60) as answer:  # noqa: S310
            assert answer.status == 200


class _Stay(urllib.request.HTTPRedirectHandler):
    def http_error_303(self, _req: Any, fp: Any, *_rest: Any) -> Any:
        return fp


def test_what_is_no_certificate_is_a_sentence(certificate: tuple[Path, Path], tmp_path: Path) -> None:
    tls_context(*certificate)
    with pytest.raises(PageError, match="a certificate and its key are needed"):
        tls_context(certificate[1], certificate[0])
    with pytest.raises(PageError, match="cannot be read"):
        tls_context(tmp_path / "none.pem", certificate[1])
