"""Who is let in: tokens, the address from the terminal, pairing."""

from __future__ import annotations

import contextlib
import sqlite3
import time
from pathlib import Path

import pytest

from config.errors import LockedError
from rid_daq.service.doorkeeper import Doorkeeper
from rid_daq.service.pairing import LASTS_S, MOST_WAITING, Pairing
from rid_daq.service.records import Role
from rid_daq.service.refusals import NotAllowedError, NotKnownError, UnknownError
from rid_daq.service.store.database import open_database
from rid_daq.service.store.tokens import TokenStore
from tests.builders.clock import Clock

PATIENCE_S = 60.0


@pytest.fixture
def tokens(tmp_path: Path) -> TokenStore:
    return TokenStore(open_database(tmp_path / "service.db"))


@pytest.fixture
def door(tokens: TokenStore) -> Doorkeeper:
    return Doorkeeper(tokens, 8642, secure=False)


def test_a_token_lets_in_until_it_is_revoked(door: Doorkeeper, tokens: TokenStore) -> None:
    token, secret = tokens.add("line computer", Role.VIEWER, person=False)
    shown = {"authorization": f"Bearer {secret}"}
    assert door.identity(shown, local=False).name == "line computer"
    tokens.revoke(token.id)
    with pytest.raises(NotKnownError, match="show a token"):
        door.identity(shown, local=False)


def test_a_database_that_another_program_holds_keeps_nobody_out(tmp_path: Path) -> None:
    database = open_database(tmp_path / "service.db")
    tokens = TokenStore(database)
    _, secret = tokens.add("tablet", Role.OPERATOR, person=True)
    assert database.flush(PATIENCE_S)
    with contextlib.closing(sqlite3.connect(tmp_path / "service.db")) as holder:
        holder.execute("BEGIN IMMEDIATE")
        door = Doorkeeper(tokens, 8642, secure=False)
        who = door.look({"authorization": f"Bearer {secret}"}, local=False)
        assert who is not None
        assert who.name == "tablet"


def test_the_secret_itself_is_not_kept(tmp_path: Path) -> None:
    database = open_database(tmp_path / "service.db")
    _, secret = TokenStore(database).add("CI", Role.OPERATOR, person=False)
    assert database.flush(PATIENCE_S)
    kept = b"".join(path.read_bytes() for path in tmp_path.iterdir())
    assert secret.encode() not in kept


def test_nobody_is_trusted_for_where_they_ask_from(door: Doorkeeper) -> None:
    assert door.look({}, local=False) is None
    assert door.look({"x-forwarded-for": "127.0.0.1"}, local=False) is None
    local = door.identity({}, local=True)
    assert (local.role, local.person) == (Role.ADMINISTRATOR, False)


def test_the_address_from_the_terminal_makes_a_cookie(door: Doorkeeper) -> None:
    cookie = door.log_in(door.link_secret)
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    who = door.identity({"cookie": cookie.partition(";")[0]}, local=False)
    assert (who.role, who.person) == (Role.ADMINISTRATOR, True)
    with pytest.raises(NotAllowedError, match="another start"):
        door.log_in("guessed")


def test_browsers_let_in_by_the_address_are_told_apart(door: Doorkeeper) -> None:
    firefox = "Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0"
    edge = "Mozilla/5.0 (Windows NT 10.0) AppleWebKit/537.36 Chrome/140.0 Safari/537.36 Edg/140.0"
    names = []
    for agent in (firefox, firefox, edge, "\x1b[31m", ""):
        cookie = door.log_in(door.link_secret, agent).partition(";")[0]
        names.append(door.identity({"cookie": cookie}, local=False).name)
    assert names == [
        "Firefox on Linux, number 1",
        "Firefox on Linux, number 2",
        "Edge on Windows, number 1",
        "browser, number 1",
        "browser, number 2",
    ]


def test_cookies_are_for_tls_alone_where_there_is_tls(tokens: TokenStore) -> None:
    assert "Secure" in Doorkeeper(tokens, 8642, secure=True).cookie("x")


def test_a_device_is_let_in_by_the_code_that_it_shows(tokens: TokenStore) -> None:
    pairing = Pairing(tokens)
    shown, secret = pairing.begin("Tablet")
    assert pairing.collect(secret) is None
    assert [each.code for each in pairing.waiting()] == [shown.code]
    pairing.confirm(shown.code, "tablet at cell 4", Role.OPERATOR)
    got = pairing.collect(secret)
    assert got is not None
    known = tokens.known(got)
    assert known is not None
    assert (known.name, known.role, known.person) == ("tablet at cell 4", Role.OPERATOR, True)
    with pytest.raises(UnknownError, match="begin again"):
        pairing.collect(secret)


def test_a_code_runs_out_and_a_wrong_one_lets_nobody_in(tokens: TokenStore) -> None:
    now_s = 0.0
    pairing = Pairing(tokens, lambda: now_s)
    shown, secret = pairing.begin("Tablet")
    wrong = f"{(int(shown.code) + 1) % 1_000_000:06d}"
    with pytest.raises(UnknownError, match="no device that waits"):
        pairing.confirm(wrong, "x", Role.VIEWER)
    now_s = LASTS_S + 1.0
    with pytest.raises(UnknownError, match="run out"):
        pairing.collect(secret)
    assert tokens.all() == []


@pytest.mark.promise("safety-clock")
def test_a_jump_of_the_date_neither_extends_nor_ends_a_code(
    tokens: TokenStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    pairing = Pairing(tokens, clock)
    for date_s in (0.0, 4e9):
        monkeypatch.setattr("time.time", lambda date_s=date_s: date_s)
        pairing.begin("Tablet")
    assert len(pairing.waiting()) == 2
    clock.now_s += LASTS_S + 1.0
    assert pairing.waiting() == []


@pytest.mark.promise("safety-clock")
def test_codes_are_timed_by_the_safety_clock(
    tokens: TokenStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairing = Pairing(tokens)
    pairing.begin("Tablet")
    assert pairing.waiting() != []
    later_s = time.clock_gettime(time.CLOCK_BOOTTIME) + LASTS_S + 60.0
    monkeypatch.setattr("time.clock_gettime", lambda _number: later_s)
    assert pairing.waiting() == []


def test_strangers_cannot_fill_the_list_of_waiting_devices(tokens: TokenStore) -> None:
    pairing = Pairing(tokens)
    for number in range(MOST_WAITING):
        pairing.begin(f"device {number}")
    with pytest.raises(LockedError, match="too many devices wait"):
        pairing.begin("one more")
