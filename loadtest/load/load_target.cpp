#include "load_target.h"

#include "connection/channel.h"

namespace marble::load {

Expected<Target> Target::open(const std::string& address, const ConnectOptions& options, int connections) {
  MARBLE_ASSIGN_OR_RETURN(const auto name, client::target_of(address));
  ConnectOptions own = options;
  own.own_connection = true;
  own.retries = false;
  Target target;
  target.address_ = address;
  target.name_ = options.name;
  if (!options.token.empty()) target.authorization_ = "Bearer " + options.token;
  for (int i = 0; i < connections; ++i) {
    MARBLE_ASSIGN_OR_RETURN(auto channel, client::open_channel(name, own));
    target.stubs_.push_back(std::make_unique<Stub>(std::move(channel)));
  }
  return target;
}

void Target::prepare(grpc::ClientContext& context, double deadline_s) const {
  if (!authorization_.empty()) context.AddMetadata("authorization", authorization_);
  if (!name_.empty()) context.AddMetadata("marble-client", name_);
  if (deadline_s > 0.0)
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * deadline_s)));
}

}  // namespace marble::load
