#include "connection/target.h"

#include <arpa/inet.h>
#include <netdb.h>

#include <charconv>
#include <memory>
#include <optional>
#include <string_view>

#include "marble/contract.h"

namespace marble::client {
namespace {

constexpr std::string_view kUnixPrefix = "unix:";
constexpr std::string_view kDnsPrefix = "dns:///";

Error bad_address(const std::string& address, const std::string& rule) {
  return invalid("address", "\"" + address + "\"", rule);
}

bool ends_in_port(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) return false;
  const char* const end = address.data() + address.size();
  int port = 0;
  const auto [stop, error] = std::from_chars(address.data() + colon + 1, end, port);
  return error == std::errc() && stop == end && port >= 1 && port <= 65535;
}

Expected<void> check(const std::string& address) {
  if (address.rfind(kUnixPrefix, 0) == 0) {
    const std::size_t length = address.size() - kUnixPrefix.size();
    if (length > 0 && length <= contract::longest_unix_path) return {};
    return unexpected(bad_address(
        address,
        "must have a path of 1 to " + std::to_string(contract::longest_unix_path) + " bytes after unix:"));
  }
  if (ends_in_port(address)) return {};
  return unexpected(bad_address(address, "must be host:port, port in [1, 65535], or unix:PATH"));
}

std::vector<std::string> split(const std::string& addresses) {
  std::vector<std::string> parts(1);
  for (const char c : addresses) {
    if (c == ',') {
      parts.emplace_back();
    } else if (c != ' ') {
      parts.back() += c;
    }
  }
  return parts;
}

struct Endpoint {
  int family = AF_INET;
  std::string text;  ///< "10.0.0.1:50051" or "[::1]:50051"
};

// Returns the first address of a name; IPv4 if it has one.
std::optional<Endpoint> look_up(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[') host = host.substr(1, host.size() - 2);
  const std::string port = address.substr(colon);
  for (const int family : {AF_INET, AF_INET6}) {
    addrinfo hints = {};
    hints.ai_family = family;
    hints.ai_socktype = SOCK_STREAM;
    addrinfo* found = nullptr;
    if (getaddrinfo(host.c_str(), nullptr, &hints, &found) != 0) continue;
    const std::unique_ptr<addrinfo, void (*)(addrinfo*)> owner(found, &freeaddrinfo);
    char text[INET6_ADDRSTRLEN] = {};
    if (getnameinfo(found->ai_addr, found->ai_addrlen, text, sizeof text, nullptr, 0, NI_NUMERICHOST) != 0)
      continue;
    return Endpoint{family, (family == AF_INET6 ? "[" + std::string(text) + "]" : text) + port};
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::string> each_address(const std::string& address) {
  if (address.rfind(kDnsPrefix, 0) == 0 || address.rfind(kUnixPrefix, 0) == 0) return {address};
  return split(address);
}

Expected<Target> target_of(const std::string& address) {
  if (address.rfind(kDnsPrefix, 0) == 0) {
    MARBLE_RETURN_IF_ERROR(check(address.substr(kDnsPrefix.size())));
    return Target{address, "", true};
  }
  const bool unix_path = address.rfind(kUnixPrefix, 0) == 0;  // may contain a comma
  const std::vector<std::string> parts = split(address);
  if (parts.size() == 1 || unix_path) {
    MARBLE_RETURN_IF_ERROR(check(address));
    return Target{address, "", false};
  }
  std::string list;
  int family = AF_UNSPEC;
  for (const std::string& part : parts) {
    MARBLE_RETURN_IF_ERROR(check(part));
    if (part.rfind(kUnixPrefix, 0) == 0 || part.rfind(kDnsPrefix, 0) == 0)
      return unexpected(bad_address(part, "cannot be one of several: only host:port can"));
    const auto endpoint = look_up(part);
    if (!endpoint) {
      return unexpected(
          failure(ErrorCode::unavailable, "address", "\"" + part + "\"", "is not known to the name service"));
    }
    if (family != AF_UNSPEC && family != endpoint->family)
      return unexpected(bad_address(part, "must be of the same kind as those before, IPv4 or IPv6"));
    family = endpoint->family;
    list += (list.empty() ? "" : ",") + endpoint->text;
  }
  return Target{(family == AF_INET ? "ipv4:" : "ipv6:") + list, parts[0].substr(0, parts[0].rfind(':')),
                true};
}

}  // namespace marble::client
