// How a client reaches its server and says who it is.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace marble {

/// Where a client connects when nothing else is said: the environment's MARBLE_SERVER, else 127.0.0.1:50051
/// (contract::default_address).
[[nodiscard]] std::string default_server_address();

/// When a server that is gone without a word counts as lost.
struct Keepalive {
  /// Silence on a connection with calls before the server is pinged, in [0.5 s, 1 day]. A server closes the
  /// connections of those that ping it more often than every half of its --keepalive-s, which is 10 s by
  /// default.
  std::chrono::duration<double> silence = std::chrono::seconds(30);
  /// How long an answer may take, and what is sent may take to arrive, in [0.001 s, 1 day].
  std::chrono::duration<double> answer = std::chrono::seconds(15);

  /// For loops that must know soon: an update that does not arrive is noticed in 1 s, silence in 12 s.
  [[nodiscard]] static Keepalive control_loop() {
    return {std::chrono::seconds(11), std::chrono::seconds(1)};
  }

  /// Whether both times are the same.
  [[nodiscard]] bool operator==(const Keepalive&) const = default;
};

/// All optional. Files are read once, by Client::connect; a bad one is an error that names its field.
struct ConnectOptions {
  /// Encrypt. Also on where any of the tls_ fields is set; off is plaintext, which a server offers on
  /// loopback.
  bool tls = false;
  std::string tls_ca = {};  ///< PEM file: who may vouch for the server; empty: gRPC's and the system's roots
  std::string tls_certificate = {};  ///< PEM file: the client's own certificate, together with tls_key
  std::string tls_key = {};          ///< PEM file: the private key of tls_certificate
  std::string tls_server_name =
      {};  ///< the name in the server's certificate, where it is not the address's host
  /// Sent with every call as "authorization: Bearer TOKEN", in plaintext too. Printable ASCII without spaces.
  std::string token = {};
  /// What the client calls itself ("marble-client"), for a server that does not know better; at most 64 bytes
  /// of printable ASCII.
  std::string name = {};
  /// The span that calls belong to, a W3C `traceparent`, sent with each; the server logs its trace. At most
  /// 512 bytes of printable ASCII; one that is not valid otherwise is ignored by the server, as the standard
  /// asks.
  std::string traceparent = {};
  /// For solves, submissions and waits for a result that have no deadline of their own, from the call on;
  /// none: they may take for ever. Sessions, batches and watches have none.
  std::optional<std::chrono::duration<double>> deadline = {};
  Keepalive keepalive = {};  ///< how soon a silent server is noticed
  /// A connection of its own. Else clients of one process with the same server and settings share one, on
  /// which each call waits for its turn to be written.
  bool own_connection = false;
  /// Whether calls that got `unavailable` before any answer are repeated; who counts failures would rather
  /// know.
  bool retries = true;

  /// MARBLE_TOKEN, MARBLE_TLS_CA, MARBLE_TLS_CERTIFICATE and MARBLE_TLS_KEY; what is not set stays empty.
  /// `traceparent` is TRACEPARENT, if it may be sent. The name is MARBLE_CLIENT_NAME, else the program's with
  /// its process id: two planners on one machine then take turns.
  [[nodiscard]] static ConnectOptions from_environment();

  /// Whether all of them are the same.
  [[nodiscard]] bool operator==(const ConnectOptions&) const = default;
};

}  // namespace marble
