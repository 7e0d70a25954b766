#include "base/origin.h"

#include <algorithm>

#include "base/random_id.h"

namespace marble::server {
namespace {

constexpr std::size_t kLongestState = 512;  // bytes; the minimum that the standard requires to pass on

// Several headers are one list.
std::string state_of(const grpc::CallbackServerContext& context) {
  std::string state;
  const auto [begin, end] = context.client_metadata().equal_range("tracestate");
  for (auto one = begin; one != end; ++one) {
    if (!state.empty()) state += ',';
    state.append(one->second.data(), one->second.size());
  }
  const bool printable = std::all_of(state.begin(), state.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return printable && state.size() <= kLongestState ? state : "";
}

}  // namespace

std::string host_of(const std::string& peer) {
  if (peer.rfind("unix", 0) == 0) return "unix";
  const std::size_t begin = peer.find(':') + 1;
  std::string host = peer.substr(begin, std::max(peer.rfind(':'), begin) - begin);
  for (const std::string bracket : {"%5B", "%5D", "[", "]"}) {
    if (const std::size_t at = host.find(bracket); at != std::string::npos) host.erase(at, bracket.size());
  }
  return host.empty() ? peer : host;
}

Origin origin_of(grpc::CallbackServerContext& context) {
  Origin origin{context.peer()};
  const auto [begin, end] = context.client_metadata().equal_range("traceparent");
  if (begin == end || std::next(begin) != end) return origin;  // several are ignored
  origin.trace = parse_traceparent({begin->second.data(), begin->second.size()}, random_id());
  if (!origin.trace) return origin;
  context.AddInitialMetadata("traceparent", to_traceparent(*origin.trace));
  if (std::string state = state_of(context); !state.empty()) context.AddInitialMetadata("tracestate", state);
  return origin;
}

}  // namespace marble::server
