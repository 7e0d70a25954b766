#include "jobs/session_table.h"

namespace marble::server {
namespace {

Error full(const char* field, std::string bound) {
  return failure(ErrorCode::resource_exhausted, field, std::move(bound));
}

}  // namespace

Expected<std::unique_ptr<SessionTable::Place>> SessionTable::open(const std::string& client,
                                                                  const Quota& quota) {
  const MutexLock lock(mutex_);
  if (usage_.sessions >= limits_.sessions) {
    return unexpected(full("sessions", "at most " + std::to_string(limits_.sessions) + " may be open"));
  }
  const auto own = of_client_.find(client);
  if ((own == of_client_.end() ? 0 : own->second) >= quota.sessions) {
    return unexpected(full("client_sessions", "the client \"" + client + "\" may have at most " +
                                                  std::to_string(quota.sessions) + " open"));
  }
  ++usage_.sessions;
  ++usage_.total;
  ++of_client_[client];
  return std::make_unique<Place>(*this, client);
}

Expected<void> SessionTable::Place::take(std::int64_t bytes) {
  const MutexLock lock(table_.mutex_);
  if (bytes > table_.limits_.bytes - table_.usage_.bytes) {
    return unexpected(full("session_bytes", "sessions may take at most " +
                                                std::to_string(table_.limits_.bytes) + " bytes together"));
  }
  table_.usage_.bytes += bytes;
  bytes_ += bytes;
  return {};
}

void SessionTable::leave(const std::string& client, std::int64_t bytes) {
  const MutexLock lock(mutex_);
  --usage_.sessions;
  usage_.bytes -= bytes;
  if (--of_client_[client] == 0) of_client_.erase(client);
}

SessionTable::Usage SessionTable::usage() const {
  const MutexLock lock(mutex_);
  return usage_;
}

std::int64_t SessionTable::room() const {
  const MutexLock lock(mutex_);
  return limits_.bytes - usage_.bytes;
}

}  // namespace marble::server
