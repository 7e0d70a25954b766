"""A relay between clients and a server that loses answers."""

from __future__ import annotations

import socket
import threading
from dataclasses import dataclass

_REQUEST_BYTES = 4000  # more than a connection's beginning has, less than the requests whose answers get lost


@dataclass
class _Connection:
    client: socket.socket
    server: socket.socket
    asked: int = 0

    def close(self) -> None:
        for end in (self.client, self.server):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


class Relay:
    """Keeps back what the server says to a request, until cut() ends the connection; later ones are passed on."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._server = host, int(port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._connections: list[_Connection] = []
        self._loses = True
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listener.accept()
                connection = _Connection(client, socket.create_connection(self._server))
            except OSError:
                return
            self._connections.append(connection)
            for pump in (self._asks, self._answers):
                threading.Thread(target=pump, args=(connection,), daemon=True).start()

    def _asks(self, connection: _Connection) -> None:
        self._pump(connection, connection.client, connection.server)

    def _answers(self, connection: _Connection) -> None:
        self._pump(connection, connection.server, connection.client)

    def _pump(self, connection: _Connection, source: socket.socket, sink: socket.socket) -> None:
        try:
            while data := source.recv(1 << 16):
                if source is connection.client:
                    connection.asked += len(data)
                elif self._loses and connection.asked > _REQUEST_BYTES:
                    continue
                sink.sendall(data)
        except OSError:
            pass
        connection.close()

    def cut(self) -> None:
        """Ends what there is; what comes then gets its answers."""
        self._loses = False
        for connection in self._connections:
            connection.close()

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()
        self.cut()
