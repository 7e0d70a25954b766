// Separate from the other arguments because only this file needs gRPC.
#include <cerrno>
#include <cstring>
#include <fstream>

#include "arguments/server_arguments.h"

namespace marble::cli {
namespace {

Expected<std::string> read_token(const std::string& path) {
  std::ifstream file(path);
  std::string token;
  if (!std::getline(file, token)) {
    const char* why = file.is_open() ? "has no first line" : std::strerror(errno);
    return unexpected(
        failure(ErrorCode::not_found, "--token-file", path, std::string("cannot be read: ") + why));
  }
  if (!token.empty() && token.back() == '\r') token.pop_back();
  return token;
}

}  // namespace

Expected<Client> connect(const ServerArguments& arguments) {
  ConnectOptions options = arguments.connect;
  if (!arguments.token_file.empty()) {
    MARBLE_ASSIGN_OR_RETURN(options.token, read_token(arguments.token_file));
  }
  return Client::connect(arguments.server, options);
}

}  // namespace marble::cli
