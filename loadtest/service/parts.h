// Declares the parts of the service benchmark: each starts its own server and prints its measurements.
#pragma once

namespace marble::bench {

/// The hopper's receding horizon, warm in a session against cold unary solves.
void mpc();
/// A control loop's steps while other clients flood the server.
void flood();
/// A control loop's steps beside long batch work of every kind, and the throughput of batch work beside
/// steps.
void beside();
/// Idle sessions.
void idle();
/// The cost of metrics, logs, traces and watchers.
void cost();
/// The same solves remote and in process; tiny ones beside a bare echo.
void remote();
/// Two workers against two threads in process.
void throughput();
/// Full load beside idle sessions and dashboards.
void crowd();
/// Submitted jobs kept in memory, by SQLite, by PostgreSQL.
void durable();
/// The cost of reporting every iteration.
void streaming();

}  // namespace marble::bench
