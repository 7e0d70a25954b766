"""What unauthenticated may send, through the proxies of deploy/proxies: the servers' memory stays, and others are served."""

import shutil
import socket
import struct

import marble
import pytest

from fleet import BUILD, FRONT, Envoy, Fleet, HAProxy, Nginx, example

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + b"\0\0\0\4\0\0\0\0\0"
MIB = 1 << 20


@pytest.fixture(scope="module")
def fleet():
    fleet = Fleet()
    yield fleet
    fleet.close()


@pytest.fixture(params=[HAProxy, Envoy], ids=lambda engine: engine.__name__)
def proxy(request, fleet):
    kind = request.param
    if not shutil.which(kind.program) and not (BUILD / "envoy" / kind.program).exists():
        pytest.skip(f"{kind.program} cannot be had")
    running = kind()
    yield running
    running.close()


def frame(kind, flags, stream, payload):
    return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


def fields(*pairs):
    return b"".join(b"\0" + bytes([len(name)]) + name + bytes([len(value)]) + value for name, value in pairs)


def call(path, *more):
    return fields((b":method", b"POST"), (b":scheme", b"http"), (b":path", path), (b":authority", b"l"), (b"te", b"trailers"),
                  (b"content-type", b"application/grpc"), *more)


def connect():
    host, port = FRONT.split(":")
    return socket.create_connection((host, int(port)), timeout=60)


def resident(pid):
    with open(f"/proc/{pid}/status", encoding="utf-8") as status:
        return 1024 * next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))


def assert_well(fleet, proxy):
    """All is small, and who comes now is served."""
    for process in [server.process for server in fleet.servers] + [proxy.process]:
        assert process.poll() is None
        assert resident(process.pid) < 512 * MIB
    with marble.Client(FRONT) as client:
        assert client.solve(example(steps=3)).solved


def pour(first, piece, most=2048 * MIB):
    """Sends `piece` again and again until the connection ends; how many bytes it took."""
    sent = 0
    with connect() as connection:
        try:
            connection.sendall(PREFACE + first)
            while sent < most:
                connection.sendall(piece)
                sent += len(piece)
        except OSError:
            return sent
    raise AssertionError("nothing ends it")


def has_ended(answers, stream):
    """Whether the server has ended the stream."""
    while len(answers) >= 9:
        size = int.from_bytes(answers[:3], "big")
        if int.from_bytes(answers[5:9], "big") == stream and (answers[3] == 3 or answers[4] & 1):
            return True
        answers = answers[9 + size:]
    return False


def wait_for_end(connection, stream):
    """Reads until the server has ended the stream or closed the connection."""
    answers = b""
    while not has_ended(answers, stream):
        piece = connection.recv(65536)
        if not piece:
            break
        answers += piece


def test_headers_without_an_end(fleet, proxy):
    part = fields((b"x-a", b"a" * 100)) * 150
    assert pour(frame(1, 0, 1, call(b"/marble.v1.Solver/Solve")), frame(9, 0, 1, part) * 20) < 256 * MIB
    assert_well(fleet, proxy)


def test_half_messages_that_stall(fleet, proxy):
    connections = [connect() for _ in range(20)]
    half = struct.pack(">BI", 0, 200 * MIB) + b"\0" * 16000
    for connection in connections:
        calls = b"".join(frame(1, 4, stream, call(b"/marble.v1.Solver/Solve")) + frame(0, 0, stream, half[:3000])
                         for stream in range(1, 40, 2))
        connection.sendall(PREFACE + calls)
    assert_well(fleet, proxy)
    for connection in connections:
        connection.close()


def test_a_gzip_bomb(fleet, proxy):
    with connect() as connection:
        connection.sendall(PREFACE + frame(1, 4, 1, call(b"/marble.v1.Solver/Solve", (b"grpc-encoding", b"gzip"))))
        wait_for_end(connection, 1)
    assert_well(fleet, proxy)


def test_silent_connections(fleet, proxy):
    silent = [connect() for _ in range(200)]
    assert_well(fleet, proxy)
    for connection in silent:
        connection.close()


@pytest.mark.parametrize("proxy", [HAProxy, Envoy, Nginx], indirect=True, ids=lambda engine: engine.__name__)
def test_headers_that_are_not_base64(fleet, proxy):
    """Each ends the connection of a bare gRPC 1.51 server, with all calls on it."""
    watching = connect()
    streams = range(1, 24, 2)
    watching.sendall(PREFACE + b"".join(frame(1, 4, stream, call(b"/marble.v1.Jobs/Watch"))
                                        + frame(0, 1, stream, b"\0\0\0\0\0") for stream in streams))
    for _ in range(40):
        with connect() as connection:
            connection.sendall(PREFACE + frame(1, 5, 1, call(b"/marble.v1.Jobs/List", (b"x-bin", b"###"))))
            wait_for_end(connection, 1)
    assert_well(fleet, proxy)
    watching.setblocking(False)
    answers = b""
    try:
        while piece := watching.recv(65536):
            answers += piece
        raise AssertionError("the connection of others has ended")
    except BlockingIOError:
        assert not any(has_ended(answers, stream) for stream in streams)
    finally:
        watching.close()
