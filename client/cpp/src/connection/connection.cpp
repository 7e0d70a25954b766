#include "connection/connection.h"

#include <algorithm>

#include "connection/channel.h"
#include "connection/patience.h"
#include "connection/traceparent.h"
#include "marble/contract.h"
#include "message_text.h"

namespace marble::client {
namespace {

constexpr std::chrono::duration<double> kLongestDeadline{std::int32_t{0x7fffffff}};
// Of the 1024 streams that a server allows on a connection by default. The first connection is shared by all
// clients of this process for that address, and carries their calls as well.
constexpr int kStreamsOfFirst = 100, kStreamsOfOthers = 900;

constexpr std::chrono::duration<double> kShortestSilence(0.5), kShortestAnswer(1e-3),
    kLongestKeepalive(86400.0);

Expected<void> check(const ConnectOptions& options) {
  // The token is a secret: no error shows it.
  if (!is_printable(options.token) || options.token.find(' ') != std::string::npos) {
    return unexpected(invalid("token", "must be printable ASCII without spaces"));
  }
  if (options.name.size() > contract::longest_client_name || !is_printable(options.name)) {
    return unexpected(invalid("name", "must be at most " + std::to_string(contract::longest_client_name) +
                                          " bytes of printable ASCII"));
  }
  const auto& [silence, answer] = options.keepalive;
  if (!(silence >= kShortestSilence && silence <= kLongestKeepalive))
    return unexpected(invalid("keepalive.silence", "must be in [0.5, 86400] seconds"));
  if (!(answer >= kShortestAnswer && answer <= kLongestKeepalive))
    return unexpected(invalid("keepalive.answer", "must be in [0.001, 86400] seconds"));
  return check_traceparent(options.traceparent);
}

// gRPC interprets a time before 1970 as "never": a negative deadline has passed now.
void set_deadline(std::chrono::duration<double> from_now, grpc::ClientContext& context) {
  if (!(from_now < kLongestDeadline)) from_now = kLongestDeadline;  // also NaN
  if (from_now.count() < 0.0) from_now = std::chrono::duration<double>::zero();
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::duration_cast<std::chrono::system_clock::duration>(from_now));
}

}  // namespace

Expected<std::shared_ptr<const Connection>> Connection::open(const std::string& address,
                                                             const ConnectOptions& options) {
  MARBLE_RETURN_IF_ERROR(check(options));
  MARBLE_ASSIGN_OR_RETURN(const auto target, target_of(address));
  MARBLE_ASSIGN_OR_RETURN(const auto channel, open_channel(target, options));
  return std::shared_ptr<const Connection>(new Connection(address, target, channel, options));
}

Expected<std::vector<std::shared_ptr<const Connection>>> Connection::each(
    const std::shared_ptr<const Connection>& all) {
  const std::vector<std::string> addresses = each_address(all->address_);
  if (addresses.size() == 1) return std::vector{all};
  ConnectOptions options = all->options_;
  options.retries = false;
  if (wants_tls(options) && options.tls_server_name.empty()) options.tls_server_name = all->target_.authority;
  std::vector<std::shared_ptr<const Connection>> result;
  for (const std::string& address : addresses) {
    MARBLE_ASSIGN_OR_RETURN(auto one, open(address, options));
    result.push_back(std::move(one));
  }
  return result;
}

Connection::Connection(std::string address, Target target, const std::shared_ptr<grpc::Channel>& channel,
                       const ConnectOptions& options)
    : address_(std::move(address)),
      target_(std::move(target)),
      authorization_(options.token.empty() ? "" : "Bearer " + options.token),
      options_(options),
      solver_(v1::Solver::NewStub(channel)),
      jobs_(v1::Jobs::NewStub(channel)),
      server_(v1::Server::NewStub(channel)),
      health_(grpc::health::v1::Health::NewStub(channel)),
      lanes_{std::make_shared<Lane>(v1::Solver::NewStub(channel))} {}

Expected<std::shared_ptr<v1::Solver::Stub>> Connection::solver_for_stream() const {
  const MutexLock lock(lanes_access_);
  std::shared_ptr<Lane> lane;
  for (const std::shared_ptr<Lane>& one : lanes_) {
    if (one->streams >= (one == lanes_.front() ? kStreamsOfFirst : kStreamsOfOthers)) continue;
    lane = one;
    break;
  }
  if (lane == nullptr) {
    ConnectOptions own = options_;
    own.own_connection = true;
    MARBLE_ASSIGN_OR_RETURN(const auto channel, open_channel(target_, own));
    lane = lanes_.emplace_back(std::make_shared<Lane>(v1::Solver::NewStub(channel)));
  }
  ++lane->streams;
  return std::shared_ptr<v1::Solver::Stub>(lane->solver.get(),
                                           [lane](v1::Solver::Stub*) { --lane->streams; });
}

void Connection::prepare(grpc::ClientContext& context,
                         std::optional<std::chrono::duration<double>> deadline) const {
  add(context, options_.traceparent, deadline);
}

Expected<void> Connection::prepare(grpc::ClientContext& context, const std::string& traceparent,
                                   std::optional<std::chrono::duration<double>> deadline) const {
  MARBLE_RETURN_IF_ERROR(check_traceparent(traceparent));
  add(context, traceparent.empty() ? options_.traceparent : traceparent, deadline);
  return {};
}

// gRPC connects only while a thread waits for a call, else once in five seconds: a call that waits for a
// server.
bool Connection::pause(std::chrono::duration<double> time, const std::stop_token& stop) const {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + time;
  grpc::ClientContext context;
  prepare(context, time);
  context.set_wait_for_ready(true);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  grpc::health::v1::HealthCheckResponse ignored;
  static_cast<void>(health_->Check(&context, {}, &ignored));
  return is_stopped_within(end - Clock::now(), stop);
}

void Connection::add(grpc::ClientContext& context, const std::string& traceparent,
                     std::optional<std::chrono::duration<double>> deadline) const {
  if (!authorization_.empty()) context.AddMetadata("authorization", authorization_);
  if (!options_.name.empty()) context.AddMetadata("marble-client", options_.name);
  if (!traceparent.empty()) context.AddMetadata("traceparent", traceparent);
  if (deadline) set_deadline(*deadline, context);
}

}  // namespace marble::client
