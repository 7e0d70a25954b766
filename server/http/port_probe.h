// Tests whether the server still accepts connections at a port: connecting alone proves nothing, because the
// kernel does it.
#pragma once

#include <chrono>
#include <vector>

namespace marble::server {

/// Connects to the address of each listening socket of this process as a client would, and waits for the
/// server's first bytes: its settings, or its part of the handshake with TLS. A server that closes the
/// connection accepts too. False if one is silent for `patience`.
[[nodiscard]] bool ports_answer(const std::vector<int>& listeners, bool tls,
                                std::chrono::milliseconds patience);

}  // namespace marble::server
