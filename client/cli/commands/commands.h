// Declares the subcommands. Each adds itself to the program and sets `exit_code` when it has run.
#pragma once

#include <CLI/CLI.hpp>

namespace marble::cli {

void add_solve(CLI::App& program, int& exit_code);
void add_explain(CLI::App& program, int& exit_code);
void add_submit(CLI::App& program, int& exit_code);
void add_result(CLI::App& program, int& exit_code);
void add_jobs(CLI::App& program, int& exit_code);
void add_job(CLI::App& program, int& exit_code);
void add_watch(CLI::App& program, int& exit_code);
void add_cancel(CLI::App& program, int& exit_code);
void add_delete(CLI::App& program, int& exit_code);
void add_batch(CLI::App& program, int& exit_code);
void add_compare(CLI::App& program, int& exit_code);
void add_reproduce(CLI::App& program, int& exit_code);
void add_coupled(CLI::App& program, int& exit_code);
void add_replay(CLI::App& program, int& exit_code);
void add_scenarios(CLI::App& program, int& exit_code);
void add_plot(CLI::App& program, int& exit_code);
void add_mpc(CLI::App& program, int& exit_code);
void add_convert(CLI::App& program, int& exit_code);
void add_example(CLI::App& program, int& exit_code);
void add_health(CLI::App& program, int& exit_code);
void add_info(CLI::App& program, int& exit_code);
void add_options(CLI::App& program, int& exit_code);
void add_completion(CLI::App& program, int& exit_code);
void add_manual(CLI::App& program, int& exit_code);
void add_version(CLI::App& program, int& exit_code);

}  // namespace marble::cli
