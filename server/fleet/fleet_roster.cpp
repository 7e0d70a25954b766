#include "fleet/fleet_roster.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/page_url.h"
#include "base/random_id.h"
#include "base/status.h"
#include "marble/version.h"

namespace marble::server {
namespace {

constexpr std::chrono::seconds kReportPeriod{2};
constexpr double kOldestReport = 4e9;  // seconds
constexpr std::int64_t kMostReported = std::int64_t{1} << 40;

// Lost with a crash of the database, and reported again after it.
constexpr const char* kLockServers = "SELECT pg_advisory_xact_lock(hashtext('marble_schema'))";
constexpr const char* kMakeServers =
    "CREATE UNLOGGED TABLE IF NOT EXISTS marble_servers (instance text PRIMARY KEY, name text NOT NULL,"
    " address text NOT NULL, page text NOT NULL, version text NOT NULL, state text NOT NULL,"
    " started timestamptz NOT NULL, seen timestamptz NOT NULL, workers bigint NOT NULL,"
    " running bigint NOT NULL, queued bigint NOT NULL, sessions bigint NOT NULL, answered bigint NOT NULL,"
    " solved bigint NOT NULL, median_s float8 NOT NULL, p99_s float8 NOT NULL)";
constexpr const char* kReportServer =
    "INSERT INTO marble_servers VALUES ($1, $2, $3, $4, $5, $6,"
    " clock_timestamp() - make_interval(secs => $7), clock_timestamp(), $8, $9, $10, $11, $12, $13, $14, $15)"
    " ON CONFLICT (instance) DO UPDATE SET state = excluded.state, seen = excluded.seen,"
    " workers = excluded.workers, running = excluded.running, queued = excluded.queued,"
    " sessions = excluded.sessions, answered = excluded.answered, solved = excluded.solved,"
    " median_s = excluded.median_s, p99_s = excluded.p99_s";
// A restarted server replaces its former report. Other lost servers are listed for a day.
constexpr const char* kForgetServers =
    "DELETE FROM marble_servers WHERE (name = $2 AND instance <> $1"
    " AND seen < clock_timestamp() - make_interval(secs => $3))"
    " OR seen < clock_timestamp() - interval '1 day' OR seen > clock_timestamp() + interval '1 day'";
constexpr const char* kListServers =
    "SELECT instance, left(name, 256), left(address, 256), left(page, 256), left(version, 64), left(state, "
    "16),"
    " (extract(epoch FROM clock_timestamp()) - extract(epoch FROM seen))::float8,"
    " (extract(epoch FROM clock_timestamp()) - extract(epoch FROM started))::float8,"
    " workers, running, queued, sessions, answered, solved, median_s, p99_s"
    " FROM marble_servers ORDER BY name, instance LIMIT 1000";
constexpr const char* kCountWaiting = "SELECT count(*) FROM marble_jobs WHERE state = 0";
constexpr const char* kLeaveServers = "DELETE FROM marble_servers WHERE instance = $1";

std::string machine_name() {
  std::array<char, 256> host = {};
  (void)gethostname(host.data(), host.size() - 1);
  return host.data();
}

double report_age(double seconds) { return seconds > 0.0 ? std::min(seconds, kOldestReport) : 0.0; }

}  // namespace

std::string reachable(const std::string& address, const std::string& host) {
  const std::size_t scheme = address.find("://");
  const std::size_t begin = scheme == std::string::npos ? 0 : scheme + 3;
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon < begin) return address;
  const std::string given = address.substr(begin, colon - begin);
  const bool is_of_all = given == "0.0.0.0" || given == "[::]" || given == "*";
  return is_of_all ? address.substr(0, begin) + host + address.substr(colon) : address;
}

FleetRoster::FleetRoster(const ServiceParts& parts) : parts_(parts), instance_(random_id()) {
  list_.error = failure(ErrorCode::unavailable, "state", "is not connected yet");
}

FleetRoster::~FleetRoster() {
  {
    const MutexLock lock(mutex_);
    closing_ = true;
    wake_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void FleetRoster::start(const std::string& address, const std::string& page) {
  const std::string host = machine_name();
  address_ = reachable(address, host);
  page_ = parts_.config.public_url.empty() ? reachable(page, host) : parts_.config.public_url;
  const std::size_t colon = address.rfind(':');
  name_ = host + (colon == std::string::npos ? "" : address.substr(colon));
  thread_ = std::thread([this] { run(); });
}

ServerList FleetRoster::servers() const {
  const MutexLock lock(mutex_);
  ServerList list = list_;
  if (read_) list.age_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - *read_).count();
  for (ListedServer& server : list.servers) {
    server.seen_s += list.age_s;
    server.uptime_s += list.age_s;
  }
  return list;
}

// No exception ends the thread, and with it the server.
void FleetRoster::run() {
  bool well = true;
  do {
    Expected<ServerList> read = unexpected(Error{});
    try {
      read = report();
    } catch (const std::exception& error) {
      read = unexpected(failure(ErrorCode::unavailable, "state", "", error.what()));
    }
    if (!read && database_) database_->close();
    if (well && !read)
      parts_.log.warn(Component::server, "server_not_listed", {{"reason", read.error().bound}});
    well = read.has_value();
    const MutexLock lock(mutex_);
    if (read) {
      list_ = std::move(*read);
      read_ = std::chrono::steady_clock::now();
    } else {
      list_.error = read.error();
    }
  } while (wait());
  if (well && database_ && database_->is_open())
    (void)database_->run(PgStatement(kLeaveServers).text(instance_));
}

bool FleetRoster::wait() {
  const auto end = std::chrono::steady_clock::now() + kReportPeriod;
  const MutexLock lock(mutex_);
  while (!closing_ && wake_.wait_until(mutex_, end) == std::cv_status::no_timeout) {
  }
  return !closing_;
}

Expected<void> FleetRoster::connect() {
  if (database_ && database_->is_open()) return {};
  MARBLE_ASSIGN_OR_RETURN(auto opened, Postgres::open(parts_.config.state));
  const std::array make = {PgStatement(kLockServers), PgStatement(kMakeServers)};
  MARBLE_RETURN_IF_ERROR(opened.run(make));
  database_ = std::move(opened);
  return {};
}

PgStatement FleetRoster::announcement() const {
  const Counters counters = parts_.scheduler.counters();
  const LastMinute::Sum minute = parts_.scheduler.last_minute();
  const Latencies::Quantiles latencies = parts_.scheduler.latencies(Latencies::kSeconds);
  return PgStatement(kReportServer)
      .text(instance_)
      .text(name_)
      .text(address_)
      .text(page_)
      .text(kVersion)
      .text(parts_.scheduler.is_draining() ? "draining" : "serving")
      .real(std::chrono::duration<double>(Clock::now() - parts_.started).count())
      .number(parts_.scheduler.limits().workers)
      .number(counters.running)
      .number(counters.queued)
      .number(parts_.sessions.usage().sessions)
      .number(minute.answered)
      .number(minute.solved)
      .real(latencies.median_s)
      .real(latencies.p99_s);
}

Expected<ServerList> FleetRoster::report() {
  MARBLE_RETURN_IF_ERROR(connect());
  std::vector<PgStatement> statements;
  statements.push_back(announcement());
  statements.push_back(
      PgStatement(kForgetServers).text(instance_).text(name_).real(parts_.config.state_lease_s));
  statements.emplace_back(kListServers);
  statements.emplace_back(kCountWaiting);
  MARBLE_ASSIGN_OR_RETURN(const auto results, database_->run(statements));
  ServerList list;
  const PgRows& rows = results[2];
  for (int row = 0; row < rows.size(); ++row) list.servers.push_back(listed(rows, row));
  list.waiting = results[3].integer(0, 0);
  return list;
}

// Others may have written anything of a column's type.
ListedServer FleetRoster::listed(const PgRows& rows, int row) const {
  const auto text = [&](int column) { return utf8(std::string(rows.bytes(row, column))); };
  const auto count = [&](int column) {
    return std::clamp<std::int64_t>(rows.integer(row, column), 0, kMostReported);
  };
  const std::string state = text(5);
  ListedServer server{.name = text(1),
                      .address = text(2),
                      .page = checked_page(text(3)),
                      .version = text(4),
                      .state = state == "draining" ? "draining" : "serving",
                      .is_this = rows.bytes(row, 0) == instance_,
                      .seen_s = report_age(rows.real(row, 6)),
                      .uptime_s = report_age(rows.real(row, 7)),
                      .workers = count(8),
                      .running = count(9),
                      .queued = count(10),
                      .sessions = count(11),
                      .answered = count(12),
                      .solved = count(13),
                      .median_s = rows.real(row, 14),
                      .p99_s = rows.real(row, 15)};
  server.is_lost = !server.is_this && server.seen_s > parts_.config.state_lease_s;
  return server;
}

}  // namespace marble::server
