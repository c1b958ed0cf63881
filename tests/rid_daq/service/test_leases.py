from __future__ import annotations

import time
from pathlib import Path

import pytest

from config.errors import ConfigError, LockedError
from rid_daq.service.leases import Leases
from rid_daq.service.records import Identity, Role
from rid_daq.service.refusals import NotAllowedError
from rid_daq.service.store.database import open_database
from rid_daq.service.store.leases import LeaseStore
from tests.builders.clock import Clock
from tests.builders.raised_codes import raises_code

ANNA = Identity(name="Anna", role=Role.OPERATOR, person=True, token="a")
BEN = Identity(name="Ben", role=Role.OPERATOR, person=True, token="b")
CI = Identity(name="CI", role=Role.OPERATOR, person=False, token="c")


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def leases(tmp_path: Path, clock: Clock) -> Leases:
    return Leases(LeaseStore(open_database(tmp_path / "service.db")), clock)


def test_a_cell_has_one_owner_until_the_lease_expires(leases: Leases, clock: Clock) -> None:
    leases.take("ir361", ANNA, "payload day", 10.0)
    with raises_code(LockedError, "RID-LEASE-OTHER", "10"):
        leases.take("ir361", BEN, "", 10.0)
    clock.now_s += 10.0
    assert leases.lease_of("ir361") is None
    assert leases.take("ir361", BEN, "", 10.0).owner == "Ben"


def test_a_heartbeat_renews_a_lease(leases: Leases, clock: Clock) -> None:
    lease = leases.take("ir361", ANNA, "", 10.0)
    for _ in range(5):
        clock.now_s += 8.0
        leases.renew("ir361", lease.key, 10.0)
    held = leases.lease_of("ir361")
    assert held is not None
    assert held.owner == "Anna"


def test_an_expired_lease_cannot_be_renewed(leases: Leases, clock: Clock) -> None:
    lease = leases.take("ir361", ANNA, "", 10.0)
    clock.now_s += 10.1
    with raises_code(LockedError, "RID-LEASE-NONE"):
        leases.renew("ir361", lease.key, 10.0)


def test_a_lease_is_returned_only_with_its_key(leases: Leases) -> None:
    lease = leases.take("ir361", ANNA, "", 10.0)
    with raises_code(LockedError, "RID-LEASE-OTHER"):
        leases.give_back("ir361", "another")
    leases.give_back("ir361", lease.key)
    assert leases.lease_of("ir361") is None


def test_a_person_takes_over_a_lease_by_confirming_the_cell_name(leases: Leases) -> None:
    before = leases.take("ir361", ANNA, "", 10.0)
    assert leases.renew("ir361", before.key, 10.0).id == before.id
    with raises_code(ConfigError, "RID-ANSWER-NO", "'ir36'"):
        leases.take("ir361", BEN, "", 10.0, confirmed="ir36")
    assert leases.take("ir361", BEN, "", 10.0, confirmed="ir361").id != before.id
    with raises_code(LockedError, "RID-LEASE-OTHER"):
        leases.require("ir361", before.key)


def test_a_program_cannot_take_over_a_lease(leases: Leases) -> None:
    leases.take("ir361", ANNA, "", 10.0)
    with raises_code(NotAllowedError, "RID-ACCESS-ROLE"):
        leases.take("ir361", CI, "", 10.0, confirmed="ir361")


@pytest.mark.parametrize("seconds", [0.0, 1.9, 3601.0, float("nan")])
def test_a_too_short_or_too_long_lease_is_refused(leases: Leases, seconds: float) -> None:
    with raises_code(ConfigError, "RID-OPTION-RANGE", "3600"):
        leases.take("ir361", ANNA, "", seconds)


@pytest.mark.promise("safety-clock")
def test_a_jump_of_the_date_neither_extends_nor_ends_a_lease(
    leases: Leases, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    lease = leases.take("ir361", ANNA, "", 10.0)
    for date_s in (0.0, 4e9):
        monkeypatch.setattr("time.time", lambda date_s=date_s: date_s)
        assert leases.renew("ir361", lease.key, 10.0).owner == "Anna"
    clock.now_s += 9.9
    assert leases.lease_of("ir361") is not None
    clock.now_s += 0.2
    assert leases.lease_of("ir361") is None


@pytest.mark.promise("safety-clock")
def test_leases_are_timed_by_the_safety_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []

    def clock_gettime(number: int) -> float:
        calls.append(number)
        return 5.0 + 100.0 * len(calls)

    leases = Leases(LeaseStore(open_database(tmp_path / "service.db")))
    monkeypatch.setattr("time.clock_gettime", clock_gettime)
    leases.take("ir361", ANNA, "", 10.0)
    assert leases.lease_of("ir361") is None
    assert set(calls) == {time.CLOCK_BOOTTIME}


@pytest.mark.promise("safety-clock")
def test_a_lease_of_another_start_of_the_computer_is_void(tmp_path: Path) -> None:
    clock = Clock()
    first = open_database(tmp_path / "service.db")
    lease = Leases(LeaseStore(first), clock, boot="a").take("ir361", ANNA, "", 60.0)
    first.close()
    again = Leases(LeaseStore(open_database(tmp_path / "service.db")), clock, boot="b")
    assert again.lease_of("ir361") is None
    with pytest.raises(LockedError) as refused:
        again.renew("ir361", lease.key, 60.0)
    assert refused.value.refusal == "RID-LEASE-NONE"


@pytest.mark.promise("safety-clock")
def test_a_lease_without_a_stored_end_is_void(tmp_path: Path) -> None:
    database = open_database(tmp_path / "service.db")
    lease = Leases(LeaseStore(database), Clock()).take("ir361", ANNA, "", 60.0)
    database.write("DELETE FROM lease_ends")
    database.close()
    again = Leases(LeaseStore(open_database(tmp_path / "service.db")), Clock())
    assert again.lease_of(lease.cell) is None


def test_a_renewed_lease_is_valid_after_a_restart(tmp_path: Path) -> None:
    clock = Clock()
    database = open_database(tmp_path / "service.db")
    leases = Leases(LeaseStore(database), clock)
    lease = leases.take("ir361", ANNA, "", 10.0)
    leases.renew("ir361", lease.key, 60.0)
    database.close()
    clock.now_s += 30.0
    again = Leases(LeaseStore(open_database(tmp_path / "service.db")), clock)
    assert again.require("ir361", lease.key).owner == "Anna"


def test_a_lease_is_valid_after_a_restart(tmp_path: Path) -> None:
    clock = Clock()
    first = open_database(tmp_path / "service.db")
    lease = Leases(LeaseStore(first), clock).take("ir361", ANNA, "", 60.0)
    first.close()
    again = Leases(LeaseStore(open_database(tmp_path / "service.db")), clock)
    assert again.require("ir361", lease.key).owner == "Anna"


def test_a_lease_ends_with_the_token_of_its_owner(leases: Leases) -> None:
    lease = leases.take("ir361", ANNA, "", 10.0)
    leases.renew("ir361", lease.key, 3600.0)
    assert leases.end_leases_of_token(BEN.token) == []
    assert leases.end_leases_of_token(ANNA.token) == ["ir361"]
    assert leases.lease_of("ir361") is None
    with raises_code(LockedError, "RID-LEASE-NONE"):
        leases.require("ir361", lease.key)


def test_a_taken_over_lease_does_not_end_with_the_previous_owners_token(leases: Leases) -> None:
    leases.take("ir361", ANNA, "", 10.0)
    leases.take("ir361", BEN, "", 10.0, confirmed="ir361")
    assert leases.end_leases_of_token(ANNA.token) == []
    held = leases.lease_of("ir361")
    assert held is not None
    assert held.owner == "Ben"
