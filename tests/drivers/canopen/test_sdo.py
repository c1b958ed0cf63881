"""SDO byte by byte (CiA 301, 7.2.4.3), and client with server under faults."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.errors import DeviceTimeoutError
from drivers.canopen.frames import Frame
from drivers.canopen.sdo import SdoAbort, SdoCode, abort_text
from drivers.canopen.sdo_client import SdoClient
from drivers.canopen.sdo_server import SdoServer
from tests.builders.raised_codes import raises_code


class Store:
    """An object dictionary of bytes; the server's two callbacks."""

    def __init__(self, **objects: bytes) -> None:
        self.objects = {(0x1000, 0): b"\x92\x01\x02\x00"}
        self.writes: list[tuple[int, int, bytes]] = []

    def read(self, index: int, subindex: int) -> bytes:
        try:
            return self.objects[index, subindex]
        except KeyError:
            raise SdoAbort(SdoCode.NO_OBJECT) from None

    def write(self, index: int, subindex: int, data: bytes) -> None:
        if index == 0x1000:
            raise SdoAbort(SdoCode.READ_ONLY)
        self.writes.append((index, subindex, data))
        self.objects[index, subindex] = data


@pytest.fixture
def store() -> Store:
    return Store()


@pytest.fixture
def server(store: Store) -> SdoServer:
    return SdoServer(2, store.read, store.write)


def request(text: str) -> Frame:
    return Frame(0x602, bytes.fromhex(text))


def answer(text: str) -> Frame:
    return Frame(0x582, bytes.fromhex(text))


def ask(server: SdoServer, text: str, now_s: float = 0.0) -> str:
    (frame,) = server.handle(request(text), now_s)
    assert frame.cob_id == 0x582
    return frame.data.hex(" ")


def run(client: SdoClient, server: SdoServer, frame: Frame | None) -> None:
    while frame is not None:
        (reply,) = server.handle(frame, 0.0)
        frame = client.handle(reply, 0.0)


class TestServerTranscripts:
    def test_an_expedited_upload_follows_its_transcript(self, server: SdoServer) -> None:
        # 7.2.4.3.5: ccs 2; scs 2, n 0, e 1, s 1
        assert ask(server, "40 00 10 00 00 00 00 00") == "43 00 10 00 92 01 02 00"

    def test_an_expedited_download_of_two_bytes_follows_its_transcript(
        self, server: SdoServer, store: Store
    ) -> None:
        # 7.2.4.3.3: ccs 1, n 2, e 1, s 1; scs 3
        assert ask(server, "2b 40 60 00 06 00 00 00") == "60 40 60 00 00 00 00 00"
        assert store.writes == [(0x6040, 0, b"\x06\x00")]

    def test_expedited_download_without_size_contains_four_bytes(
        self, server: SdoServer, store: Store
    ) -> None:
        assert ask(server, "22 40 60 00 06 00 00 00") == "60 40 60 00 00 00 00 00"
        assert store.writes == [(0x6040, 0, b"\x06\x00\x00\x00")]

    def test_a_segmented_upload_follows_its_transcript(
        self, server: SdoServer, store: Store
    ) -> None:
        # 7.2.4.3.5 and 7.2.4.3.6; the text is that of the canopen package's own transcript
        store.objects[0x1008, 0] = b"Tiny Node - Mega Domains !"
        assert ask(server, "40 08 10 00 00 00 00 00") == "41 08 10 00 1a 00 00 00"
        assert ask(server, "60 00 00 00 00 00 00 00") == "00 54 69 6e 79 20 4e 6f"
        assert ask(server, "70 00 00 00 00 00 00 00") == "10 64 65 20 2d 20 4d 65"
        assert ask(server, "60 00 00 00 00 00 00 00") == "00 67 61 20 44 6f 6d 61"
        assert ask(server, "70 00 00 00 00 00 00 00") == "15 69 6e 73 20 21 00 00"

    def test_a_segmented_download_follows_its_transcript(
        self, server: SdoServer, store: Store
    ) -> None:
        # 7.2.4.3.3 and 7.2.4.3.4
        assert ask(server, "21 00 20 00 0d 00 00 00") == "60 00 20 00 00 00 00 00"
        assert ask(server, "00 41 20 6c 6f 6e 67 20") == "20 00 00 00 00 00 00 00"
        assert ask(server, "13 73 74 72 69 6e 67 00") == "30 00 00 00 00 00 00 00"
        assert store.writes == [(0x2000, 0, b"A long string")]

    def test_invalid_requests_are_refused_with_their_abort_code(self, server: SdoServer) -> None:
        # 7.2.4.3.17 with table 22
        assert ask(server, "40 00 30 07 00 00 00 00") == "80 00 30 07 00 00 02 06"
        assert ask(server, "2f 00 10 00 01 00 00 00") == "80 00 10 00 02 00 01 06"

    def test_a_toggle_bit_that_does_not_alternate_is_refused(
        self, server: SdoServer, store: Store
    ) -> None:
        ask(server, "21 00 20 00 0d 00 00 00")
        assert ask(server, "10 41 20 6c 6f 6e 67 20") == "80 00 20 00 00 00 03 05"
        assert ask(server, "00 41 20 6c 6f 6e 67 20") == "80 41 20 6c 01 00 04 05"
        assert store.writes == []

    def test_block_transfer_is_refused(self, server: SdoServer) -> None:
        # 7.2.4.3.9: ccs 6; a server without block transfer answers 0504 0001h
        assert ask(server, "c2 00 20 00 20 00 00 00") == "80 00 20 00 01 00 04 05"

    def test_a_transfer_shorter_or_longer_than_announced_is_aborted(
        self, server: SdoServer
    ) -> None:
        ask(server, "21 00 20 00 09 00 00 00")
        assert ask(server, "01 41 20 6c 6f 6e 67 20") == "80 00 20 00 13 00 07 06"
        ask(server, "21 00 20 00 05 00 00 00")
        assert ask(server, "01 41 20 6c 6f 6e 67 20") == "80 00 20 00 12 00 07 06"

    def test_an_interrupted_transfer_is_aborted_after_the_timeout(self, server: SdoServer) -> None:
        ask(server, "21 00 20 00 09 00 00 00", now_s=1.0)
        assert ask(server, "00 41 20 6c 6f 6e 67 20", now_s=3.0) == "80 00 20 00 00 00 04 05"

    def test_too_much_data_is_refused_before_it_is_stored(self, server: SdoServer) -> None:
        assert ask(server, "21 00 20 00 00 00 00 10") == "80 00 20 00 05 00 04 05"

    @pytest.mark.parametrize(
        "frame",
        [request("40 00 10 00"), Frame(0x601, bytes(8)), request("80 00 10 00 00 00 04 05")],
    )
    def test_frames_that_need_no_answer_get_none(self, server: SdoServer, frame: Frame) -> None:
        assert server.handle(frame, 0.0) == []


class TestClientAgainstServer:
    @given(st.binary(max_size=100))
    def test_written_data_is_read_back(self, data: bytes) -> None:
        store = Store()
        server = SdoServer(2, store.read, store.write)
        client = SdoClient(2)
        run(client, server, client.download(0x2000, 3, data, 0.0))
        assert client.done
        assert client.result() == b""
        assert store.writes == [(0x2000, 3, data)]
        run(client, server, client.upload(0x2000, 3, 0.0))
        assert client.done
        assert client.result() == data

    def test_four_bytes_take_one_message(self) -> None:
        client = SdoClient(2)
        assert client.download(0x60C2, 2, b"\xfd", 0.0) == request("2f c2 60 02 fd 00 00 00")
        assert client.upload(0x60C2, 2, 0.0) == request("40 c2 60 02 00 00 00 00")

    def test_a_refusal_names_node_object_and_reason(self, server: SdoServer) -> None:
        client = SdoClient(2)
        run(client, server, client.upload(0x3000, 7, 0.0))
        with raises_code(SdoAbort, "RID-DRIVE-REFUSED", "3000h:07", "06020000h"):
            client.result()

    def test_an_unknown_abort_code_is_shown_as_a_number(self) -> None:
        assert abort_text(0x0800_4711) == "abort code 08004711h"

    def test_a_missing_answer_is_a_timeout(self) -> None:
        client = SdoClient(2, timeout_s=0.5)
        client.upload(0x6041, 0, 10.0)
        assert client.check(10.49) is None
        assert client.check(10.5) == request("80 41 60 00 00 00 04 05")
        with raises_code(DeviceTimeoutError, "RID-DRIVE-SILENT", "6041h:00"):
            client.result()

    def test_a_late_answer_is_not_used_for_the_next_request(self, server: SdoServer) -> None:
        client = SdoClient(2)
        client.upload(0x6041, 0, 0.0)
        client.check(1.0)
        client.upload(0x1000, 0, 1.0)
        assert client.handle(answer("4b 41 60 00 37 06 00 00"), 1.1) is None
        assert client.handle(answer("80 41 60 00 00 00 02 06"), 1.1) is None
        assert not client.done
        client.handle(answer("43 00 10 00 92 01 02 00"), 1.2)
        assert client.result() == b"\x92\x01\x02\x00"

    def test_an_answer_lost_within_a_transfer_is_a_timeout(
        self, server: SdoServer, store: Store
    ) -> None:
        store.objects[0x1008, 0] = bytes(20)
        client = SdoClient(2)
        (begun,) = server.handle(client.upload(0x1008, 0, 0.0), 0.0)
        assert client.handle(begun, 0.0) is not None
        abort = client.check(0.6)
        assert abort is not None
        assert server.handle(abort, 0.6) == []
        with pytest.raises(DeviceTimeoutError):
            client.result()
        run(client, server, client.upload(0x1000, 0, 0.7))
        assert len(client.result()) == 4

    def test_a_repeated_segment_is_refused(self) -> None:
        client = SdoClient(2)
        client.upload(0x1008, 0, 0.0)
        client.handle(answer("41 08 10 00 1a 00 00 00"), 0.0)
        client.handle(answer("00 54 69 6e 79 20 4e 6f"), 0.0)
        refusal = client.handle(answer("00 54 69 6e 79 20 4e 6f"), 0.0)
        assert refusal == request("80 08 10 00 00 00 03 05")
        with raises_code(SdoAbort, "RID-DRIVE-REFUSED", "toggle"):
            client.result()

    def test_fewer_bytes_than_announced_are_refused(self) -> None:
        client = SdoClient(2)
        client.upload(0x1008, 0, 0.0)
        client.handle(answer("41 08 10 00 1a 00 00 00"), 0.0)
        refusal = client.handle(answer("01 54 69 6e 79 20 4e 6f"), 0.0)
        assert refusal == request("80 08 10 00 10 00 07 06")

    def test_a_wrong_command_is_answered_with_an_abort(self) -> None:
        client = SdoClient(2)
        client.upload(0x1008, 0, 0.0)
        refusal = client.handle(answer("60 08 10 00 00 00 00 00"), 0.0)
        assert refusal == request("80 08 10 00 01 00 04 05")

    @given(st.lists(st.binary(min_size=8, max_size=8), max_size=20), st.booleans())
    def test_any_bytes_to_the_client_are_handled(self, messages: list[bytes], upload: bool) -> None:
        client = SdoClient(2)
        if upload:
            client.upload(0x1008, 0, 0.0)
        else:
            client.download(0x1008, 0, bytes(30), 0.0)
        for data in messages:
            client.handle(Frame(0x582, data), 0.0)
        client.check(99.0)
        assert client.done

    @given(st.lists(st.binary(max_size=8), max_size=30))
    def test_any_bytes_to_the_server_are_handled(self, messages: list[bytes]) -> None:
        store = Store()
        server = SdoServer(2, store.read, store.write)
        for data in messages:
            answers = server.handle(Frame(0x602, data), 0.0)
            assert all(len(frame.data) == 8 for frame in answers)
