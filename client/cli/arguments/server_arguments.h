// What all commands share that talk to a server: which one, by what right, and in which form to print.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "marble/client.h"

namespace marble::cli {

struct ServerArguments {
  std::string server = default_server_address();
  ConnectOptions connect = ConnectOptions::from_environment();
  std::string token_file;
  std::string output = "text";
  [[nodiscard]] bool json() const { return output == "json"; }
};

void add_server_arguments(CLI::App& command, ServerArguments& arguments);
[[nodiscard]] std::shared_ptr<ServerArguments> add_server_arguments(CLI::App& command);

/// --priority, for commands that solve.
void add_priority_argument(CLI::App& command, Priority& priority);

/// Reads the token, and connects with the first call.
[[nodiscard]] Expected<Client> connect(const ServerArguments& arguments);

/// Prints what is wrong with the server and returns the exit code for it.
[[nodiscard]] int server_fails(const ServerArguments& arguments, const Error& error);

/// Prints what is wrong with a job, or with the server, and returns the exit code for it. With `json` prints
/// an object for the job too.
[[nodiscard]] int job_fails(const ServerArguments& arguments, const std::string& job_id, const Error& error);

}  // namespace marble::cli
