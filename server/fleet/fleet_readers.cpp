#include "fleet/fleet_readers.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/status.h"
#include "fleet/fleet_array_statements.h"
#include "fleet/fleet_store.h"
#include "google/rpc/status.pb.h"

namespace marble::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kApart{20};          // between two reads for readers that wait
constexpr milliseconds kUnannounced{1000};  // likewise, without a notification

Error error_in(std::string_view bytes) {
  google::rpc::Status status;
  if (status.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return error_of(status);
  return failure(ErrorCode::internal, "the stored array cannot be read");
}

}  // namespace

void FleetReaders::find(const std::string& id, Find then) {
  {
    const MutexLock lock(mutex_);
    finds_.push_back({id, std::move(then)});
  }
  ring_();
}

void FleetReaders::ask(std::weak_ptr<FleetArrayResults> reader) {
  {
    const MutexLock lock(mutex_);
    asked_.push_back(std::move(reader));
  }
  ring_();
}

milliseconds FleetReaders::patience(milliseconds most) const {
  return waiting_.empty() || !changed_ ? most : std::min(most, kApart);
}

void FleetReaders::refuse(const Error& why) {
  std::vector<Lookup> finds;
  {
    const MutexLock lock(mutex_);
    finds.swap(finds_);
  }
  for (const Lookup& find : finds) find.then(unexpected(why));
}

Expected<void> FleetReaders::serve_finds(Postgres& database) {
  while (true) {
    std::string id;
    {
      const MutexLock lock(mutex_);
      if (finds_.empty()) return {};
      id = finds_.back().id;
    }
    MARBLE_ASSIGN_OR_RETURN(const auto rows, database.run(PgStatement(kFindArray).text(id)));
    Find then;
    {
      const MutexLock lock(mutex_);  // another may have come meanwhile, after this one
      const auto found = std::ranges::find(finds_, id, &Lookup::id);
      then = std::move(found->then);
      finds_.erase(found);
    }
    if (rows.size() == 0) {
      then(unexpected(no_array(id)));
    } else {
      then(FoundArray{std::make_shared<FleetArrayResults>(*this, id), std::string(rows.bytes(0, 0)),
                      rows.integer(0, 1)});
    }
  }
}

Expected<void> FleetReaders::serve(Postgres& database, bool changed) {
  MARBLE_RETURN_IF_ERROR(serve_finds(database));
  const auto now = std::chrono::steady_clock::now();
  changed_ = changed_ || changed || now - served_ >= kUnannounced;
  Readers readers, waiting;
  if (changed_ && now - served_ >= kApart) {
    readers.swap(waiting_);
    changed_ = false;
    served_ = now;
  }
  {
    const MutexLock lock(mutex_);
    readers.insert(readers.end(), asked_.begin(), asked_.end());
    asked_.clear();
  }
  Expected<void> served;
  for (const auto& weak : readers) {
    const auto reader = weak.lock();
    if (reader == nullptr) continue;
    const auto waits = served ? reader->read(database) : Expected<bool>(true);
    if (!waits) {
      served = unexpected(waits.error());
      changed_ = true;
    }
    if (!waits || *waits) waiting_.push_back(weak);
  }
  return served;
}

Expected<ArraySource::News> FleetArrayResults::news_after(std::int64_t sequence, std::int64_t most_bytes) {
  {
    const MutexLock lock(mutex_);
    if (is_gone_) return unexpected(array_deleted(id_));
    if (news_ && after_ == sequence) return *std::exchange(news_, std::nullopt);
    after_ = sequence;
    most_bytes_ = most_bytes;
    news_.reset();
    if (std::exchange(waits_, true)) return News();
  }
  readers_.ask(weak_from_this());
  return News();
}

void FleetArrayResults::listen(const std::weak_ptr<ArrayListener>& listener) {
  const MutexLock lock(mutex_);
  listener_ = listener;
}

Expected<bool> FleetArrayResults::read(Postgres& database) {
  std::int64_t after = 0, most_bytes = 0;
  {
    const MutexLock lock(mutex_);
    after = after_;
    most_bytes = most_bytes_;
  }
  bool gone = false;
  MARBLE_ASSIGN_OR_RETURN(auto news, read_news(database, after, most_bytes, gone));
  if (!gone && !news.is_over && news.answers.empty()) return true;
  std::shared_ptr<ArrayListener> listener;
  {
    const MutexLock lock(mutex_);
    waits_ = false;
    is_gone_ = gone;
    news_ = std::move(news);
    listener = listener_.lock();
  }
  if (listener != nullptr) listener->news();
  return false;
}

// The state first: an array that is over has all its results.
Expected<ArraySource::News> FleetArrayResults::read_news(Postgres& database, std::int64_t after,
                                                         std::int64_t most_bytes, bool& gone) const {
  const std::array both = {PgStatement(kArrayState).text(id_),
                           PgStatement(kArrayAnswers).text(id_).number(after).number(most_bytes)};
  MARBLE_ASSIGN_OR_RETURN(const auto rows, database.run(both));
  const PgRows& state = rows.front();
  gone = state.size() == 0;
  News news;
  if (gone) return news;
  news.answers = answers_in(rows.back(), id_);
  news.is_over = state.truth(0, 0) && news.answers.empty();
  if (news.is_over && !state.bytes(0, 1).empty()) news.end = error_in(state.bytes(0, 1));
  return news;
}

}  // namespace marble::server
