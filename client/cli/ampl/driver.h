// The program as a solver of AMPL's: what AMPL, Pyomo, JuMP and others call with an .nl file.
#pragma once

namespace marble::cli::ampl {

/// Reads STUB.nl, solves it where `server` or MARBLE_SERVER say, else in this process, and writes STUB.sol.
/// Options come from the environment's marble_options and from the command line, which counts. Returns 0
/// whenever there is a .sol file: what did not go well is in its message and its code. Else the program's
/// exit code, with the reason on standard error.
[[nodiscard]] int drive(int argc, const char* const* argv);

}  // namespace marble::cli::ampl
