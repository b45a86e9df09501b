"""The password of a journal's database never appears: in no error, no setting and no log."""

import pytest

from pzctl.daemon.files.config import ConfigError, settings
from pzctl.daemon.files.database_url import without_password
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.store import JournalError

URLS = [
    "postgresql://a:secret@127.0.0.1:1/x",
    "postgresql://127.0.0.1:1/x?user=a&password=secret",
    "postgres://127.0.0.1:1/x?password=secret&sslmode=disable",
    "postgres://127.0.0.1:1/x?PassWord=secret",
    "postgresql://127.0.0.1:1/x?%70assword=secret",
    "postgresql://127.0.0.1:1/x?sslpassword=secret",
    "postgresql://a:se@secret@127.0.0.1:1/x",
    "postgresql://a:secret/more@127.0.0.1:1/x",
    "postgresql://a:secret",
    "postgresql://a:secret?more@127.0.0.1:1/x",
    "postgresql://a:secret%@127.0.0.1:1/x",
    "postgresql://a:secret@[::1]:1/x",
    "postgresql://127.0.0.1:1/x?secret",
    "postgresql://a:secret@127.0.0.1:1,127.0.0.1:2/x",
]


@pytest.mark.parametrize("url", URLS)
def test_a_password_is_never_shown(url: str) -> None:
    assert "secret" not in without_password(url)
    assert "***" in without_password(url)


@pytest.mark.parametrize("url", URLS)
def test_no_error_on_the_way_to_a_server_shows_it(url: str, tmp_path, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(JournalError) as refused:
        JournalWriter(tmp_path / "journal", url, "bench")
    error: BaseException | None = refused.value
    while error is not None:  # a traceback in the log also shows the cause of an error
        assert "secret" not in str(error)
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    assert "secret" not in caplog.text


@pytest.mark.parametrize("url", ["mysql" + url[url.index(":") :] for url in URLS])
def test_a_setting_that_is_refused_does_not_show_it(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for given in ({"journal": url}, {"diagnose": url}):
        with pytest.raises(ConfigError) as refused:
            settings(given)
        assert "secret" not in str(refused.value)
    monkeypatch.setenv("PZCTL_JOURNAL", url)
    with pytest.raises(ConfigError) as refused:
        settings({})
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize(
    "url", ["postgresql://pzctl@lab-server/pzctl", "postgresql:///x?host=/run/pg&port=5433", "/mnt/archive/journal"]
)
def test_addresses_without_a_password_are_shown_in_full(url: str) -> None:
    assert without_password(url) == url
