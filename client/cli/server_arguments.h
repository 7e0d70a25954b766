// What health and info share: which server, and in which form to print.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "marble/client.h"

namespace marble::cli {

struct ServerArguments {
  std::string server = default_server_address();
  bool json() const { return output == "json"; }
  std::string output = "text";
};

[[nodiscard]] std::shared_ptr<ServerArguments> add_server_arguments(CLI::App& command);

/// Prints what is wrong with the server and returns the exit code for it.
[[nodiscard]] int server_fails(const ServerArguments& arguments, const Error& error);

}  // namespace marble::cli
