// Runs the program as an AMPL solver: AMPL, Pyomo, JuMP and others call it with an .nl file.
#pragma once

namespace marble::cli::ampl {

/// Reads STUB.nl, solves it on the server of `server` or MARBLE_SERVER, else in this process, and writes
/// STUB.sol. Options come from the environment's marble_options and from the command line, which overrides.
/// Returns 0 whenever there is a .sol file: its message and its code report failures. Otherwise returns the
/// program's exit code, with the reason on standard error.
[[nodiscard]] int drive(int argc, const char* const* argv);

}  // namespace marble::cli::ampl
