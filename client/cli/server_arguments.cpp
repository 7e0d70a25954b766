#include "server_arguments.h"

#include <iostream>

#include "exit_code.h"

namespace marble::cli {

std::shared_ptr<ServerArguments> add_server_arguments(CLI::App& command) {
  auto arguments = std::make_shared<ServerArguments>();
  command
      .add_option("--server", arguments->server,
                  "address of the server: host:port or unix:PATH; default MARBLE_SERVER, else "
                  "127.0.0.1:50051")
      ->capture_default_str();
  command.add_option("--output", arguments->output, "text or json")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  return arguments;
}

int server_fails(const ServerArguments& arguments, const Error& error) {
  std::cerr << "marble: server " << arguments.server << ": " << error.message() << '\n';
  return error.code == ErrorCode::invalid_argument ? kBadInput : kUnreachable;
}

}  // namespace marble::cli
