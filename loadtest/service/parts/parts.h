// The parts of the service benchmark: each starts a server of its own and prints what it measures.
#pragma once

namespace marble::bench {

/// The hopper's receding horizon, warm in a session against cold unary solves.
void mpc();
/// A control loop's ticks while others flood the server.
void flood();
/// Sessions that do nothing.
void idle();
/// What metrics, logs, traces and those who watch cost.
void cost();
/// The same solves here and there; tiny ones beside a bare echo.
void remote();
/// Two workers against two threads here.
void throughput();
/// Full load beside idle sessions and dashboards.
void crowd();
/// Submitted jobs kept in memory, by SQLite, by PostgreSQL.
void durable();
/// What telling every iteration costs the solve.
void streaming();

}  // namespace marble::bench
