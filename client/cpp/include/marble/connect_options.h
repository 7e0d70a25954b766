// Provides the options of a connection: how a client reaches its server and identifies itself.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace marble {

/// Returns the address that a client connects to by default: the environment's MARBLE_SERVER, else
/// 127.0.0.1:50051 (contract::default_address).
[[nodiscard]] std::string default_server_address();

/// When a server that stops responding counts as lost.
struct Keepalive {
  /// Silence on a connection with calls after which the client pings the server, in [0.5 s, 1 day]. A server
  /// closes the connections of clients that ping it more often than every half of its --keepalive-s, which is
  /// 10 s by default.
  std::chrono::duration<double> silence = std::chrono::seconds(30);
  /// How long a response may take, and how long sent data may take to arrive, in [0.001 s, 1 day].
  std::chrono::duration<double> answer = std::chrono::seconds(15);

  /// For control loops that must detect a loss soon: an update that does not arrive is noticed in 1 s,
  /// silence in 12 s.
  [[nodiscard]] static Keepalive control_loop() {
    return {std::chrono::seconds(11), std::chrono::seconds(1)};
  }

  /// True if both times are the same.
  [[nodiscard]] bool operator==(const Keepalive&) const = default;
};

/// All fields are optional. Client::connect reads the files once; a bad file is an error that names its
/// field.
struct ConnectOptions {
  /// Use TLS. Also on if any of the tls_ fields is set; off is plaintext, which a server offers on loopback.
  bool tls = false;
  std::string tls_ca = {};           ///< PEM file: trusted root certificates; empty: gRPC's and the system's
  std::string tls_certificate = {};  ///< PEM file: the client's own certificate, together with tls_key
  std::string tls_key = {};          ///< PEM file: the private key of tls_certificate
  std::string tls_server_name =
      {};  ///< the name in the server's certificate, if it is not the address's host
  /// Sent with every call as "authorization: Bearer TOKEN", in plaintext too. Printable ASCII without spaces.
  std::string token = {};
  /// The client's own name ("marble-client"), for a server that has no better information; at most 64 bytes
  /// of printable ASCII.
  std::string name = {};
  /// The span that calls belong to, a W3C `traceparent`, sent with each call; the server logs its trace. At
  /// most 512 bytes of printable ASCII. The server ignores one that is otherwise invalid, as the standard
  /// requires.
  std::string traceparent = {};
  /// For solves, submissions and waits for a result that have no deadline of their own, counted from the
  /// call. Absent: no limit. Sessions, batches and watches have none.
  std::optional<std::chrono::duration<double>> deadline = {};
  Keepalive keepalive = {};  ///< how soon a silent server is noticed
  /// Use a separate connection. By default, clients of one process with the same server and settings share
  /// one, and their calls take turns to write on it.
  bool own_connection = false;
  /// Whether calls that get `unavailable` before any response are retried; switch it off to count failures.
  bool retries = true;

  /// Returns options from MARBLE_TOKEN, MARBLE_TLS_CA, MARBLE_TLS_CERTIFICATE and MARBLE_TLS_KEY; unset ones
  /// stay empty. `traceparent` is TRACEPARENT, if it may be sent. The name is MARBLE_CLIENT_NAME, else the
  /// program's name with its process id, so that two planners on one machine take turns.
  [[nodiscard]] static ConnectOptions from_environment();

  /// True if all of them are the same.
  [[nodiscard]] bool operator==(const ConnectOptions&) const = default;
};

}  // namespace marble
