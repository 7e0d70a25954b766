// Every kind of client there is.
#pragma once

#include <memory>

#include "client.h"

namespace marble::testing {

using MakeClient = std::unique_ptr<Client> (*)(Environment&, std::uint64_t seed);

// Unary solves.
std::unique_ptr<Client> make_solve_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_deadline_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_malformed_client(Environment& environment, std::uint64_t seed);
// Streams: read to the end, cancelled at any moment, hardly read.
std::unique_ptr<Client> make_stream_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_cancel_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_slow_reader(Environment& environment, std::uint64_t seed);
// Many problems on a stream, some of them malformed, some streams given up.
std::unique_ptr<Client> make_batch_client(Environment& environment, std::uint64_t seed);
// Sessions that are used, and sessions that are left open.
std::unique_ptr<Client> make_session_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_idle_session(Environment& environment, std::uint64_t seed);
// Submitted jobs, and those who watch them all.
std::unique_ptr<Client> make_submit_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_watch_client(Environment& environment, std::uint64_t seed);
// Asks for health and counters all the time.
std::unique_ptr<Client> make_health_client(Environment& environment, std::uint64_t seed);
// Processes that are killed with -9 in the middle of a stream, a batch or a session.
std::unique_ptr<Client> make_killed_client(Environment& environment, std::uint64_t seed);
// Frames by hand that no client library would send.
std::unique_ptr<Client> make_hostile_client(Environment& environment, std::uint64_t seed);

}  // namespace marble::testing
