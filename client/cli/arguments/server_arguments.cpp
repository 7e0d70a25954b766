#include "arguments/server_arguments.h"

#include <iostream>
#include <map>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "output/json.h"

namespace marble::cli {
void add_server_arguments(CLI::App& command, ServerArguments& arguments) {
  command.add_option("--server", arguments.server,
                     "server address: host:port, several of them separated by commas, unix:PATH, or local "
                     "for this process; default: MARBLE_SERVER, then 127.0.0.1:50051");
  command.add_option("--token-file", arguments.token_file,
                     "file whose first line is the access token; default: the token in MARBLE_TOKEN");
  command.add_flag("--tls", arguments.connect.tls,
                   "encrypt the connection; implied by any other --tls option");
  command.add_option("--tls-ca", arguments.connect.tls_ca,
                     "PEM file with the certificate authorities that may sign the server's certificate; "
                     "default: MARBLE_TLS_CA, then the system's");
  command.add_option("--tls-certificate", arguments.connect.tls_certificate,
                     "PEM file with the client's certificate; default: MARBLE_TLS_CERTIFICATE");
  command.add_option("--tls-key", arguments.connect.tls_key,
                     "PEM file with the key of the client's certificate; default: MARBLE_TLS_KEY");
  command.add_option("--tls-server-name", arguments.connect.tls_server_name,
                     "host name in the server's certificate, if it differs from the address");
  command.add_option("--client-name", arguments.connect.name, "client name, for connections without a token");
  command.add_option("--output", arguments.output, "output format: text, or json with one object per line")
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
      .add_option("--priority", priority, "priority in the server's queue: realtime, interactive or batch")
      ->transform(CLI::CheckedTransformer(names).description(""))
      ->type_name("TEXT:{realtime,interactive,batch}");
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
