// Whether somebody still accepts at a port: a connection alone does not tell, the kernel makes it.
#pragma once

#include <chrono>
#include <vector>

namespace marble::server {

/// Connects to the address of each listening socket of this process as a client would, and waits for what the
/// server says first: its settings, with TLS its part of the handshake. One who hangs up accepts too. False
/// if one is silent for `patience`.
[[nodiscard]] bool ports_answer(const std::vector<int>& listeners, bool tls,
                                std::chrono::milliseconds patience);

}  // namespace marble::server
