#include "arguments/server_arguments.h"

#include <iostream>
#include <map>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "output/json.h"

namespace marble::cli {
void add_server_arguments(CLI::App& command, ServerArguments& arguments) {
  command.add_option("--server", arguments.server,
                     "address of the server: host:port, or several with commas between, or unix:PATH; "
                     "or local, which is this process; default MARBLE_SERVER, else 127.0.0.1:50051");
  command.add_option("--token-file", arguments.token_file,
                     "its first line is the token to show; default the token in MARBLE_TOKEN");
  command.add_flag("--tls", arguments.connect.tls, "encrypt; any other --tls option does so too");
  command.add_option("--tls-ca", arguments.connect.tls_ca,
                     "PEM file of who may vouch for the server; default MARBLE_TLS_CA, else the system's");
  command.add_option("--tls-certificate", arguments.connect.tls_certificate,
                     "PEM file of the client's own certificate; default MARBLE_TLS_CERTIFICATE");
  command.add_option("--tls-key", arguments.connect.tls_key, "PEM file of its key; default MARBLE_TLS_KEY");
  command.add_option("--tls-server-name", arguments.connect.tls_server_name,
                     "the name in the server's certificate, where it is not the address's");
  command.add_option("--client-name", arguments.connect.name, "what to be called where there is no token");
  command.add_option("--output", arguments.output, "text, or json: one object a line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

std::shared_ptr<ServerArguments> add_server_arguments(CLI::App& command) {
  auto arguments = std::make_shared<ServerArguments>();
  add_server_arguments(command, *arguments);
  return arguments;
}

void add_priority_argument(CLI::App& command, Priority& priority) {
  const std::map<std::string, Priority> names = {
      {"realtime", Priority::realtime}, {"interactive", Priority::interactive}, {"batch", Priority::batch}};
  command
      .add_option("--priority", priority,
                  "whose turn it is when the server is busy: realtime, interactive or batch")
      ->transform(CLI::CheckedTransformer(names).description(""))
      ->type_name("TEXT");
}

int server_fails(const ServerArguments& arguments, const Error& error) {
  complain("server " + arguments.server, error.message());
  const bool usage = error.code == ErrorCode::invalid_argument || error.code == ErrorCode::not_found;
  return usage ? kBadInput : kUnreachable;
}

int job_fails(const ServerArguments& arguments, const std::string& job_id, const Error& error) {
  const bool unreachable = error.code == ErrorCode::unavailable;
  complain(unreachable ? "server " + arguments.server : "job " + job_id, error.message());
  if (arguments.json())
    std::cout << line({{"job_id", job_id}, {"status", "error"}, {"error", to_json(error)}}) << '\n'
              << std::flush;
  return exit_code_of(error);
}

}  // namespace marble::cli
