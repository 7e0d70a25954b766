// Provides the arguments of all commands that contact a server: address, credentials and output format.
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

/// Adds --priority, for commands that solve.
void add_priority_argument(CLI::App& command, Priority& priority);

/// Reads the token and creates the client, which connects with the first call.
[[nodiscard]] Expected<Client> connect(const ServerArguments& arguments);

/// Prints an error of the server and returns its exit code.
[[nodiscard]] int server_fails(const ServerArguments& arguments, const Error& error);

/// Prints an error of a job or of the server and returns its exit code. With `json` also prints an object for
/// the job.
[[nodiscard]] int job_fails(const ServerArguments& arguments, const std::string& job_id, const Error& error);

}  // namespace marble::cli
