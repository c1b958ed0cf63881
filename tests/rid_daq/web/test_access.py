"""Access rules of the live page: addresses, names, origins and tokens."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import ConfigError
from rid_daq.web.access import Access
from tests.builders.raised_codes import raises_code

TOKEN = "a" * 40


@pytest.fixture
def access() -> Access:
    return Access("127.0.0.1", 8642, TOKEN)


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    path = tmp_path / "token"
    path.write_text(TOKEN + "\n")
    return path


@pytest.mark.parametrize("listen", ["127.0.0.1:8642", "[::1]:0", "localhost:1", "127.9.9.9:5"])
def test_a_loopback_address_needs_no_options_and_gets_a_new_token(listen: str) -> None:
    one, two = Access.of_options(listen), Access.of_options(listen)
    assert one.token != two.token
    assert len(one.token) >= 32
    assert one.scheme == "http"


@pytest.mark.parametrize("listen", ["0.0.0.0:8642", "[::]:8642", "192.168.1.7:8642"])
def test_another_address_needs_a_token_and_tls(listen: str, secret: Path, tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-LISTEN-UNPROTECTED", "--token", "--certificate"):
        Access.of_options(listen)
    with raises_code(ConfigError, "RID-LISTEN-UNPROTECTED", "--certificate"):
        Access.of_options(listen, token=secret)
    certificate = tmp_path / "live.pem"
    certificate.write_text("x")
    with raises_code(ConfigError, "RID-LISTEN-UNPROTECTED", "--token"):
        Access.of_options(listen, certificate=certificate)
    assert Access.of_options(listen, secret, certificate).url.startswith("https://")


@pytest.mark.parametrize(
    "listen", ["8642", "example.com:80", "127.0.0.1", "127.0.0.1:99999", "", "[::1:80", "a b:1"]
)
def test_an_invalid_address_or_port_is_refused(listen: str) -> None:
    with raises_code(ConfigError, "RID-LISTEN-ADDRESS"):
        Access.of_options(listen)


@pytest.mark.parametrize("text", ["short", "x" * 31, "y" * 40 + "; Path", "", "é" * 40])
def test_a_weak_token_is_refused(secret: Path, text: str) -> None:
    secret.write_text(text, encoding="utf-8")
    code = "RID-LISTEN-CREDENTIALS" if text.isascii() else "RID-FILE-READ"
    with raises_code(ConfigError, code, "--token"):
        Access.of_options(token=secret)


def test_a_file_that_is_not_a_certificate_is_refused(secret: Path) -> None:
    with raises_code(ConfigError, "RID-LISTEN-CREDENTIALS"):
        _ = Access.of_options(certificate=secret).tls()
    with raises_code(ConfigError, "RID-FILE-UNKNOWN"):
        Access.of_options(certificate=secret.with_name("missing"))


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8642", "localhost:8642", "[::1]:8642", "LOCALHOST:8642"]
)
def test_literal_loopback_names_are_accepted(access: Access, host: str) -> None:
    assert access.is_own_name(host)


@pytest.mark.parametrize(
    "host",
    [
        "",
        "evil.example:8642",
        "127.0.0.1.evil.example:8642",
        "localhost.evil.example:8642",
        "127.0.0.1:80",
        "127.0.0.1",
        "192.168.1.7:8642",
        "evil@127.0.0.1:8642",
        "127.0.0.1:8642/x",
        "[::1:8642",
        "2130706433:8642",
    ],
)
def test_a_foreign_host_name_is_refused(access: Access, host: str) -> None:
    assert not access.is_own_name(host)


def test_the_own_address_is_accepted_as_host() -> None:
    everywhere = Access("0.0.0.0", 8642, TOKEN, Path("x"))
    assert everywhere.is_own_name("192.168.1.7:8642")
    assert not everywhere.is_own_name("evil.example:8642")
    one = Access("192.168.1.7", 8642, TOKEN, Path("x"))
    assert one.is_own_name("192.168.1.7:8642")
    assert not one.is_own_name("192.168.1.8:8642")


HOST = {"host": "127.0.0.1:8642"}


@pytest.mark.parametrize(
    ("headers", "ours"),
    [
        ({}, True),
        ({"origin": "http://127.0.0.1:8642"}, True),
        ({"sec-fetch-site": "same-origin"}, True),
        ({"sec-fetch-site": "none"}, True),
        ({"origin": "http://127.0.0.1:8643"}, False),
        ({"origin": "https://127.0.0.1:8642"}, False),
        ({"origin": "http://localhost:8642"}, False),
        ({"origin": "null"}, False),
        ({"origin": "https://evil.example"}, False),
        ({"sec-fetch-site": "cross-site"}, False),
        ({"sec-fetch-site": "same-site"}, False),
    ],
)
def test_only_requests_of_the_own_origin_are_accepted(
    access: Access, headers: dict[str, str], ours: bool
) -> None:
    assert access.is_own_page(HOST | headers) is ours


@pytest.mark.parametrize(
    ("headers", "known"),
    [
        ({}, False),
        ({"authorization": f"Bearer {TOKEN}"}, True),
        ({"authorization": f"Basic {TOKEN}"}, False),
        ({"authorization": "Bearer é"}, False),
    ],
)
def test_the_token_is_accepted_as_a_bearer_token(
    access: Access, headers: dict[str, str], known: bool
) -> None:
    assert access.admits(headers, None) is known


@pytest.mark.parametrize("session", ["", "é", TOKEN])
def test_another_session_gives_no_access(access: Access, session: str) -> None:
    assert access.admits({}, access.session)
    assert not access.admits({}, session)
