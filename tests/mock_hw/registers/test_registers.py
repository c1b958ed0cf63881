"""Simulated registers on real sockets and serial ports, read by the driver and by mbpoll.

The simulated side follows the specification, the driver uses pymodbus, and mbpoll uses libmodbus:
three independent implementations.
"""

from __future__ import annotations

import re
import shutil
import socket
import struct
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.cell.drive_profile import POLLED
from config.cell.monitor import ModbusRtu, ModbusTcp, ModbusTls, MonitorConfig
from config.errors import DeviceTimeoutError, ProtocolError, TransportError
from drivers.modbus.codec import plan_reads
from drivers.modbus.drive_monitor import ModbusDriveMonitor
from drivers.modbus.link import open_modbus
from mock_hw.registers.server import ServerCertificates
from tests.builders.raised_codes import raises_code
from tests.builders.register_workshop import (
    PROFILE,
    TIMEOUT_S,
    UNITS,
    Workshop,
    at_first,
)

Measured = Callable[[str], None]


@pytest.fixture
def workshop(tmp_path: Path) -> Iterator[Workshop]:
    with ExitStack() as stack:
        yield Workshop(tmp_path, stack)


def monitor(config: MonitorConfig, workshop: Workshop, **changes: Any) -> ModbusDriveMonitor:
    link = workshop._stack.enter_context(open_modbus(config, workshop.pause))
    workshop.link = link
    return ModbusDriveMonitor(link, changes.get("units", UNITS), PROFILE)


@pytest.mark.parametrize("kind", ["tcp", "rtu"])
class TestDriver:
    def test_the_driver_reads_temperatures_and_operating_times(
        self, workshop: Workshop, kind: str
    ) -> None:
        reading = monitor(workshop.serve(kind), workshop).read()
        assert reading.temperature_k.tolist() == pytest.approx([293.15, 303.15, 373.15])
        assert reading.operating_time_s.tolist() == pytest.approx([7201.0, 7202.0, 7209.0])
        assert reading.problems == ()

    def test_the_driver_reads_nominal_data(self, workshop: Workshop, kind: str) -> None:
        (motor, *others) = monitor(workshop.serve(kind), workshop).motors()
        assert motor.torque_constant_nm_per_a == pytest.approx(0.9)
        assert motor.torque_constant_per_k == pytest.approx(-0.001)
        assert motor.rated_torque_nm == pytest.approx(4.6)
        assert motor.rotor_inertia_kg_m2 == pytest.approx(0.0015)
        assert others == [motor, motor]

    def test_the_driver_reads_the_other_drives_if_one_is_missing(
        self, workshop: Workshop, kind: str
    ) -> None:
        config = workshop.serve(kind).model_copy(update={"timeout_s": TIMEOUT_S})
        reading = monitor(config, workshop, units=(1, 77, 9)).read()
        assert reading.temperature_k[[0, 2]].tolist() == pytest.approx([293.15, 373.15])
        (problem,) = reading.problems
        gateway = "exception 11: the drive does not answer the gateway"
        why = gateway if kind == "tcp" else "no answer"
        assert "unit 77" in problem
        assert why in problem

    @pytest.mark.fault(31)
    def test_the_driver_reports_a_refusal_with_registers_and_reason(
        self, workshop: Workshop, kind: str, measured: Measured
    ) -> None:
        config = workshop.serve(kind, fault=at_first("exception", code=2))
        with open_modbus(config) as link:
            (read,) = plan_reads(PROFILE, POLLED)
            with raises_code(ProtocolError, "RID-MODBUS-PROFILE", "100", "103"):
                link.read(1, read)
        assert workshop.requests == 1
        measured(f"{kind}, a refusal: one request, the message explains the exception")

    @pytest.mark.fault(31)
    def test_a_drive_that_is_busy_is_not_reported_as_a_wrong_profile(
        self, workshop: Workshop, kind: str
    ) -> None:
        config = workshop.serve(kind, fault=at_first("exception", code=6))
        with open_modbus(config) as link:
            (read,) = plan_reads(PROFILE, POLLED)
            with raises_code(ProtocolError, "RID-MODBUS-SILENT", "busy"):
                link.read(1, read)

    @pytest.mark.fault(31)
    def test_the_driver_reports_silence_as_a_timeout(
        self, workshop: Workshop, kind: str, measured: Measured
    ) -> None:
        config = workshop.serve(kind, fault=at_first("silent"))
        line = monitor(config, workshop)
        (read,) = plan_reads(PROFILE, POLLED)
        with raises_code(DeviceTimeoutError, "RID-MODBUS-SILENT"):
            line._link.read(1, read)
        assert workshop.requests == 1
        assert line.read().problems == ()
        measured(f"{kind}, silence: one request, the next request is answered")

    @pytest.mark.fault(31)
    @pytest.mark.parametrize("fault", ["short", "wrong_unit", "garbage"])
    def test_the_driver_reports_a_damaged_answer_and_reads_the_next_one(
        self, workshop: Workshop, kind: str, fault: Any, measured: Measured
    ) -> None:
        line = monitor(workshop.serve(kind, fault=at_first(fault)), workshop)
        first, second = line.read(), line.read()
        assert len(first.problems) == 1
        assert first.temperature_k[1:].tolist() == pytest.approx([303.15, 373.15])
        assert second.problems == ()
        assert workshop.requests == 2 * len(UNITS)
        measured(f"{kind}, {fault}: 1 of 6 values missing, 6 requests for 6 values")

    @pytest.mark.fault(31)
    def test_the_driver_does_not_use_a_late_answer_for_the_next_request(
        self, workshop: Workshop, kind: str, measured: Measured
    ) -> None:
        """Unit 1 is read twice; its late first answer must not count as the second one."""
        line = monitor(workshop.serve(kind, fault=at_first("late")), workshop)
        workshop.late = True
        first = line.read()
        assert len(first.problems) == 1
        assert first.temperature_k[1:].tolist() == pytest.approx([303.15, 373.15])
        assert line.read().temperature_k.tolist() == pytest.approx([293.15, 303.15, 373.15])
        assert workshop.requests == 2 * len(UNITS)
        measured(f"{kind}, late: 1 of 6 values missing, 0 wrong, 6 requests for 6 values")


def test_an_implausible_motor_temperature_is_refused(workshop: Workshop) -> None:
    config = workshop.serve("tcp")
    scaled = PROFILE.registers["motor_temperature_k"].model_copy(update={"scale": 1.0})
    wrong = PROFILE.model_copy(
        update={"registers": PROFILE.registers | {"motor_temperature_k": scaled}}
    )
    with open_modbus(config) as link:
        reading = ModbusDriveMonitor(link, (9,), wrong).read()
    assert "check register, type and scale" in reading.problems[0]


def test_a_gateway_without_power_is_distinguished_from_silent_drives(
    workshop: Workshop,
) -> None:
    line = monitor(workshop.serve("tcp"), workshop)
    assert line.read().problems == ()
    assert workshop.service is not None
    workshop.service.close()
    with raises_code(TransportError, "RID-MODBUS-OPEN"):
        line.read()


def test_a_missing_gateway_is_an_error(workshop: Workshop, tmp_path: Path) -> None:
    config = workshop.serve("tcp")
    assert workshop.service is not None
    workshop.service.close()
    with raises_code(TransportError, "RID-MODBUS-OPEN", "127.0.0.1:", "monitor.link"):
        open_modbus(config)
    line = ModbusRtu(kind="rtu", address=str(tmp_path / "nothing"))
    with raises_code(TransportError, "RID-MODBUS-OPEN", "monitor.link"):
        open_modbus(config.model_copy(update={"link": line}))


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two authorities, and certificates of a drive and of a computer."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    folder = tmp_path_factory.mktemp("tls")

    def openssl(*words: str) -> None:
        command = ["openssl", *words]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=120.0)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
    for name in ("ca", "other"):
        openssl(
            "req", "-x509", *key, "-keyout", f"{name}.key", "-out", f"{name}.pem",
            "-days", "3650", "-subj", f"/CN={name}",
            "-addext", "keyUsage=critical,keyCertSign,cRLSign",
        )  # fmt: skip
    for name in ("drive", "computer"):
        # Python 3.13 and newer refuse certificates without these extensions
        (folder / f"{name}.ext").write_text(
            f"subjectAltName=DNS:{name}.cell\nbasicConstraints=CA:FALSE\n"
            "subjectKeyIdentifier=hash\nauthorityKeyIdentifier=keyid\n"
        )
        openssl(
            "req", "-new", *key, "-keyout", f"{name}.key", "-out", f"{name}.csr",
            "-subj", f"/CN={name}.cell",
        )  # fmt: skip
        openssl(
            "x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key",
            "-CAcreateserial", "-out", f"{name}.pem", "-days", "3650",
            "-extfile", f"{name}.ext",
        )  # fmt: skip
    return folder


class TestTls:
    def serve(self, workshop: Workshop, authority: Path, **changes: Any) -> MonitorConfig:
        tls = ModbusTls(
            ca_file=str(authority / changes.get("ca", "ca.pem")),
            certificate_file=changes.get("own", str(authority / "computer.pem")),
            key_file=None if "own" in changes else str(authority / "computer.key"),
            server_name=changes.get("name", "drive.cell"),
        )
        files = ServerCertificates(
            authority / "drive.pem", authority / "drive.key", authority / "ca.pem"
        )
        return workshop.serve("tcp", tls=tls, certificates=files)

    def test_tls_needs_a_certificate(self, workshop: Workshop) -> None:
        with raises_code(TransportError, "RID-MOCK-REGISTERS"):
            workshop.serve("tcp", tls=ModbusTls(ca_file="ca.pem", server_name="drive.cell"))

    def test_tls_checks_the_certificates_of_both_sides(
        self, workshop: Workshop, authority: Path
    ) -> None:
        reading = monitor(self.serve(workshop, authority), workshop).read()
        assert reading.temperature_k.tolist() == pytest.approx([293.15, 303.15, 373.15])

    def test_a_drive_with_a_certificate_of_another_authority_is_refused(
        self, workshop: Workshop, authority: Path
    ) -> None:
        with raises_code(TransportError, "RID-MODBUS-OPEN"):
            open_modbus(self.serve(workshop, authority, ca="other.pem"))

    def test_a_drive_with_a_certificate_of_another_name_is_refused(
        self, workshop: Workshop, authority: Path
    ) -> None:
        with raises_code(TransportError, "RID-MODBUS-OPEN", "'robot.cell'"):
            open_modbus(self.serve(workshop, authority, name="robot.cell"))

    def test_a_computer_without_certificate_gets_no_answer(
        self, workshop: Workshop, authority: Path
    ) -> None:
        config = self.serve(workshop, authority, own=None)
        try:
            reading = monitor(config, workshop).read()
        except TransportError:
            return  # refused already during the handshake
        assert reading.problems
        assert np.isnan(reading.temperature_k).all()

    def test_missing_certificate_files_are_reported_with_their_names(
        self, workshop: Workshop, authority: Path
    ) -> None:
        with raises_code(TransportError, "RID-MODBUS-OPEN"):
            open_modbus(self.serve(workshop, authority, ca="nothing.pem"))


def test_a_connection_with_another_protocol_is_closed(workshop: Workshop) -> None:
    workshop.serve("tcp")
    assert workshop.service is not None
    with socket.create_connection(("127.0.0.1", workshop.service.port), 5.0) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert connection.recv(100) == b""


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed")
class TestMbpoll:
    """mbpoll is an independent master; it counts registers from 1."""

    def poll(self, *words: str) -> str:
        command = ["mbpoll", "-1", "-q", "-t", "4", *words]
        run = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=False)
        return run.stdout + run.stderr

    def values(self, text: str) -> dict[int, int]:
        found = re.findall(r"\[(\d+)\]:\s+(-?\d+)", text)
        return {int(place): int(value) for place, value in found}

    def test_mbpoll_reads_over_tcp(self, workshop: Workshop) -> None:
        config = workshop.serve("tcp")
        assert isinstance(config.link, ModbusTcp)
        port = str(config.link.port)
        text = self.poll("-a", "9", "-r", "101", "-c", "4", "-p", port, "127.0.0.1")
        assert self.values(text) == {101: 1000, 102: 0, 103: 7209000 >> 16, 104: 7209000 & 0xFFFF}

    def test_mbpoll_reads_over_a_serial_line(self, workshop: Workshop) -> None:
        config = workshop.serve("rtu")
        assert isinstance(config.link, ModbusRtu)
        words = ["-m", "rtu", "-b", "19200", "-P", "none", "-a", "2", "-r", "101", "-c", "1"]
        assert self.values(self.poll(*words, config.link.address)) == {101: 300}

    def test_mbpoll_reports_a_missing_register(self, workshop: Workshop) -> None:
        config = workshop.serve("tcp")
        assert isinstance(config.link, ModbusTcp)
        text = self.poll("-a", "1", "-r", "501", "-p", str(config.link.port), "127.0.0.1")
        assert "Illegal data address" in text


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tsharks_modbus_dissector_decodes_the_conversation(
    workshop: Workshop, tmp_path: Path
) -> None:
    workshop.serve("tcp")
    assert workshop.service is not None
    requests = [
        bytes.fromhex("000100000006090300640004"),
        bytes.fromhex("000200000006010301F40001"),
    ]
    messages = []
    with socket.create_connection(("127.0.0.1", workshop.service.port), 5.0) as connection:
        for request in requests:
            connection.sendall(request)
            messages += [(True, request), (False, connection.recv(300))]
    capture = tmp_path / "modbus.pcap"
    capture.write_bytes(pcap(messages))
    dissected = subprocess.run(
        [
            *("tshark", "-r", str(capture), "-T", "fields", "-E", "separator=|"),
            *("-e", "_ws.col.Protocol", "-e", "modbus.func_code", "-e", "modbus.regval_uint16"),
            *("-e", "modbus.exception_code", "-e", "_ws.expert.message"),
        ],
        capture_output=True,
        text=True,
        check=True,
        timeout=120.0,
    ).stdout.splitlines()
    values = f"1000,0,{7209000 >> 16},{7209000 & 0xFFFF}"
    assert dissected == [
        "Modbus/TCP|3|||",
        f"Modbus/TCP|3|{values}||",
        "Modbus/TCP|3|||",
        "Modbus/TCP|3||2|",
    ]


def pcap(messages: list[tuple[bool, bytes]]) -> bytes:
    """Return a capture of a conversation with port 502: raw IPv4 packets with TCP segments."""
    packets = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 101)]
    sequence = {True: 1, False: 1}
    for number, (to_server, payload) in enumerate(messages):
        ports = (40000, 502) if to_server else (502, 40000)
        numbers = sequence[to_server], sequence[not to_server]
        tcp = struct.pack(">HHIIBBHHH", *ports, *numbers, 0x50, 0x18, 8192, 0, 0)
        sequence[to_server] += len(payload)
        length = 20 + len(tcp) + len(payload)
        home = bytes((127, 0, 0, 1))
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, length, number, 0, 64, 6, 0, home, home)
        packet = ip + tcp + payload
        packets.append(struct.pack("<IIII", number, 0, len(packet), len(packet)) + packet)
    return b"".join(packets)
