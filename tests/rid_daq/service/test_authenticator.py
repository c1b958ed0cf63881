"""Authentication by tokens, by the address from the terminal, and by pairing."""

from __future__ import annotations

import contextlib
import sqlite3
import time
from pathlib import Path

import pytest

from config.errors import LockedError
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.pairing import (
    LASTS_S,
    MOST_OF_ADDRESS,
    MOST_WAITING,
    MOST_WRONG,
    Pairing,
)
from rid_daq.service.records import Role
from rid_daq.service.refusals import NotAllowedError, NotKnownError, UnknownError
from rid_daq.service.store.database import open_database
from rid_daq.service.store.tokens import UNUSED_S, TokenStore
from tests.builders.clock import Clock
from tests.builders.raised_codes import raises_code

PATIENCE_S = 60.0


@pytest.fixture
def tokens(tmp_path: Path) -> TokenStore:
    return TokenStore(open_database(tmp_path / "service.db"))


@pytest.fixture
def door(tokens: TokenStore) -> Authenticator:
    return Authenticator(tokens, 8642, secure=False)


def test_a_token_is_valid_until_it_is_revoked(door: Authenticator, tokens: TokenStore) -> None:
    token, secret = tokens.add("line computer", Role.VIEWER, person=False)
    shown = {"authorization": f"Bearer {secret}"}
    assert door.require_identity(shown, local=False).name == "line computer"
    tokens.revoke(token.id)
    with raises_code(NotKnownError, "RID-ACCESS-UNKNOWN"):
        door.require_identity(shown, local=False)


def test_tokens_are_valid_while_another_program_locks_the_database(tmp_path: Path) -> None:
    database = open_database(tmp_path / "service.db")
    tokens = TokenStore(database)
    _, secret = tokens.add("tablet", Role.OPERATOR, person=True)
    assert database.flush(PATIENCE_S)
    with contextlib.closing(sqlite3.connect(tmp_path / "service.db")) as holder:
        holder.execute("BEGIN IMMEDIATE")
        door = Authenticator(tokens, 8642, secure=False)
        who = door.find_identity({"authorization": f"Bearer {secret}"}, local=False)
        assert who is not None
        assert who.name == "tablet"


def test_the_secret_itself_is_not_stored(tmp_path: Path) -> None:
    database = open_database(tmp_path / "service.db")
    _, secret = TokenStore(database).add("CI", Role.OPERATOR, person=False)
    assert database.flush(PATIENCE_S)
    kept = b"".join(path.read_bytes() for path in tmp_path.iterdir())
    assert secret.encode() not in kept


def test_a_forwarded_address_gives_no_access(door: Authenticator) -> None:
    assert door.find_identity({}, local=False) is None
    assert door.find_identity({"x-forwarded-for": "127.0.0.1"}, local=False) is None
    local = door.require_identity({}, local=True)
    assert (local.role, local.person) == (Role.ADMINISTRATOR, False)


def bearer(secret: str) -> dict[str, str]:
    return {"authorization": f"Bearer {secret}"}


def test_the_address_from_the_terminal_logs_a_browser_in(door: Authenticator) -> None:
    who = door.require_identity(bearer(door.log_in(door.link_secret)), local=False)
    assert (who.role, who.person) == (Role.ADMINISTRATOR, True)
    with raises_code(NotAllowedError, "RID-ACCESS-UNKNOWN"):
        door.log_in("guessed")


def test_browsers_logged_in_by_the_address_get_different_names(door: Authenticator) -> None:
    firefox = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0"
    edge = "Mozilla/5.0 (Windows NT 10.0) AppleWebKit/537.36 Chrome/140.0 Safari/537.36 Edg/140.0"
    names = []
    for agent in (firefox, firefox, edge, "\x1b[31m", ""):
        secret = door.log_in(door.link_secret, agent)
        names.append(door.require_identity(bearer(secret), local=False).name)
    assert names == [
        "Firefox on Linux, number 1",
        "Firefox on Linux, number 2",
        "Edge on Windows, number 1",
        "browser, number 1",
        "browser, number 2",
    ]


@pytest.mark.promise("no-cookie-without-tls")
def test_without_tls_cookies_are_neither_set_nor_accepted(door: Authenticator) -> None:
    secret = door.log_in(door.link_secret)
    for name in ("rid_daq_service_8642", "__Host-rid-daq-8642", "rid-daq session"):
        assert door.find_identity({"cookie": f"{name}={secret}"}, local=False) is None
    with pytest.raises(RuntimeError):
        door.cookie(secret)


def test_a_websocket_authenticates_by_its_subprotocol(door: Authenticator) -> None:
    secret = door.log_in(door.link_secret)
    shown = {"sec-websocket-protocol": f"rid-daq, rid-daq.{secret}"}
    assert door.find_identity(shown, local=False) is not None
    assert door.find_identity({"sec-websocket-protocol": "rid-daq"}, local=False) is None


@pytest.mark.promise("session-ends-with-the-service")
def test_a_session_of_an_earlier_start_can_only_stop(
    door: Authenticator, tokens: TokenStore
) -> None:
    link = door.log_in(door.link_secret)
    code, waiting = door.pairing.begin("127.0.0.1")
    door.pairing.confirm(code, "tablet", Role.OPERATOR)
    paired = door.pairing.collect(waiting)
    assert paired is not None
    _, program = tokens.add("CI", Role.OPERATOR, person=False)
    after = Authenticator(tokens, 8642, secure=False)
    for secret in (link, paired):
        assert after.find_identity(bearer(secret), local=False) is None
        assert after.has_issued_secret(bearer(secret))
    assert after.find_identity(bearer(program), local=False) is not None


@pytest.mark.promise("cookie-of-this-host")
def test_a_cookie_is_limited_to_tls_and_this_host(tokens: TokenStore) -> None:
    door = Authenticator(tokens, 8642, secure=True)
    cookie = door.cookie(door.log_in(door.link_secret))
    assert cookie.startswith("__Host-rid-daq-8642=")
    assert "; Secure; HttpOnly; SameSite=Strict; Path=/" in cookie
    assert "Max-Age" not in cookie  # it ends with the browser
    assert (
        door.find_identity({"cookie": f"a=b; {cookie.partition(';')[0]}"}, local=False) is not None
    )


def test_a_paired_device_in_use_stays_valid_after_a_restart(
    tokens: TokenStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    door = Authenticator(tokens, 8642, secure=True)
    code, waiting = door.pairing.begin("10.0.0.7")
    door.pairing.confirm(code, "tablet", Role.OPERATOR)
    secret = door.pairing.collect(waiting)
    assert secret is not None
    cookie = door.cookie(secret)
    assert f"Max-Age={UNUSED_S:.0f}" in cookie
    shown = {"cookie": cookie.partition(";")[0]}
    after = Authenticator(tokens, 8642, secure=True)
    assert after.find_identity(shown, local=False) is not None
    assert after.renewed_cookie(shown) == cookie
    later_s = time.time() + UNUSED_S + 1.0
    monkeypatch.setattr(time, "time", lambda: later_s)
    assert after.find_identity(shown, local=False) is None
    assert after.renewed_cookie(shown) is None


@pytest.mark.promise("one-download-a-ticket")
def test_a_ticket_is_valid_once_for_one_path(door: Authenticator) -> None:
    secret = door.log_in(door.link_secret)
    path = "/api/v1/runs/one/report"
    elsewhere, used = door.tickets.issue(secret, path), door.tickets.issue(secret, path)
    assert door.tickets.redeem(elsewhere, "/api/v1/runs/other/report") is None
    assert door.tickets.redeem(elsewhere, path) is None
    assert door.tickets.redeem(used, path) == secret
    assert door.tickets.redeem(used, path) is None


def test_a_device_is_paired_by_the_code_that_it_shows(tokens: TokenStore) -> None:
    pairing = Pairing(tokens)
    code, secret = pairing.begin("10.0.0.7")
    assert pairing.collect(secret) is None
    (waits,) = pairing.waiting()
    assert (waits.code, waits.device) == ("", "10.0.0.7")
    pairing.confirm(code, "tablet at cell 4", Role.OPERATOR)
    got = pairing.collect(secret)
    assert got is not None
    known = tokens.find_token(got)
    assert known is not None
    assert (known.name, known.role, known.person) == ("tablet at cell 4", Role.OPERATOR, True)
    with pytest.raises(UnknownError) as refused:
        pairing.collect(secret)
    assert refused.value.refusal == "RID-PAIR-OVER"


@pytest.mark.promise("safety-clock")
def test_a_jump_of_the_date_neither_extends_nor_ends_a_code(
    tokens: TokenStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    pairing = Pairing(tokens, now_s=clock)
    for date_s in (0.0, 4e9):
        monkeypatch.setattr("time.time", lambda date_s=date_s: date_s)
        pairing.begin("10.0.0.7")
    assert len(pairing.waiting()) == 2
    clock.now_s += LASTS_S + 1.0
    assert pairing.waiting() == []


@pytest.mark.promise("safety-clock")
def test_codes_are_timed_by_the_safety_clock(
    tokens: TokenStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairing = Pairing(tokens)
    pairing.begin("10.0.0.7")
    assert pairing.waiting() != []
    later_s = time.clock_gettime(time.CLOCK_BOOTTIME) + LASTS_S + 60.0
    monkeypatch.setattr("time.clock_gettime", lambda _number: later_s)
    assert pairing.waiting() == []


def wrong_code(code: str) -> str:
    return f"{(int(code) + 1) % 1_000_000:06d}"


def test_an_expired_or_wrong_code_pairs_no_device(tokens: TokenStore) -> None:
    clock = Clock()
    pairing = Pairing(tokens, now_s=clock)
    code, secret = pairing.begin("10.0.0.7")
    with pytest.raises(UnknownError) as refused:
        pairing.confirm(wrong_code(code), "x", Role.VIEWER)
    assert refused.value.refusal == "RID-PAIR-CODE"
    clock.now_s += LASTS_S + 1.0
    with pytest.raises(UnknownError) as over:
        pairing.collect(secret)
    assert over.value.refusal == "RID-PAIR-OVER"
    assert tokens.all() == []


@pytest.mark.promise("typed-code")
def test_wrong_codes_are_counted(tokens: TokenStore) -> None:
    clock = Clock()
    pairing = Pairing(tokens, now_s=clock)
    code, _ = pairing.begin("10.0.0.7")
    for _ in range(MOST_WRONG):
        with pytest.raises(UnknownError):
            pairing.confirm(wrong_code(code), "x", Role.VIEWER, by="guesser")
    with pytest.raises(LockedError) as refused:
        pairing.confirm(code, "x", Role.VIEWER, by="guesser")
    assert refused.value.refusal == "RID-PAIR-ATTEMPTS"
    clock.now_s += LASTS_S - 1.0
    assert pairing.confirm(code, "x", Role.VIEWER, by="another").name == "x"


@pytest.mark.promise("places-by-address")
def test_pairing_requests_are_limited_for_each_address(tokens: TokenStore) -> None:
    pairing = Pairing(tokens)
    for _ in range(MOST_OF_ADDRESS):
        pairing.begin("10.0.0.66")
    with pytest.raises(LockedError) as refused:
        pairing.begin("10.0.0.66")
    assert refused.value.refusal == "RID-PAIR-FULL"
    code, _ = pairing.begin("10.0.0.7")
    assert pairing.confirm(code, "tablet", Role.VIEWER).name == "tablet"


def test_the_list_of_waiting_devices_is_bounded(tokens: TokenStore) -> None:
    pairing = Pairing(tokens)
    for number in range(MOST_WAITING):
        pairing.begin(f"address {number}")
    with pytest.raises(LockedError) as refused:
        pairing.begin("one more")
    assert refused.value.refusal == "RID-PAIR-FULL"
