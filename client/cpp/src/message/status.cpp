#include "message/status.h"

#include <charconv>
#include <string_view>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "marble/contract.h"
#include "marble/convert.h"
#include "marble/v1/fault.pb.h"

namespace marble::client {
namespace {

// Converts "solve.problem.equality_matrix.values[3]" to field "A.values", index 3.
void take_field(std::string path, Error& error) {
  for (const std::string_view prefix : {"solve.", "setup.", "update.", "problem.", "options."}) {
    if (path.rfind(prefix, 0) == 0) path.erase(0, prefix.size());
  }
  if (!path.empty() && path.back() == ']') {
    const std::size_t open = path.rfind('[');
    if (open != std::string::npos) {
      std::from_chars(path.data() + open + 1, path.data() + path.size() - 1, error.index);
      path.erase(open);
    }
  }
  error.field = core_field(path);
}

// Returns the first number after these words in a text.
std::int64_t number_after(std::string_view text, std::string_view words) {
  std::int64_t number = 0;
  const std::size_t at = text.find(words);
  if (at == std::string_view::npos) return 0;
  text.remove_prefix(at + words.size());
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

// True if a request has more bytes than all requests may have together: waiting does not help.
bool is_too_large(const v1::Fault& fault) {
  if (fault.field() != "queue_bytes" && fault.field() != "client_bytes") return false;
  const std::int64_t most = number_after(fault.bound(), "at most ");
  return most > 0 && number_after(fault.value(), "") > most;
}

constexpr std::pair<std::string_view, std::string_view> kHints[] = {
    {"Socket closed",
     "; does the server want TLS (--tls, MARBLE_TLS_CA), or a certificate of the client "
     "(MARBLE_TLS_CERTIFICATE)?"},
    {"Connection reset", "; does the server want TLS (--tls, MARBLE_TLS_CA)?"},
    {"wrong version number",
     "; does the server speak without TLS? This client uses it (--tls, MARBLE_TLS_CA)"},
    {"certificate verify failed", "; --tls-ca or MARBLE_TLS_CA names who vouches for the server"},
};

// Returns a possible reason if gRPC made no connection.
std::string hint_of(std::string_view message) {
  const auto says = [&](std::string_view words) { return message.find(words) != std::string_view::npos; };
  if (says(contract::default_address) && says("Connection refused"))
    return std::string(contract::no_server_hint) + contract::local_hint;
  if (!says("failed to connect to all addresses") && !says("connections to all backends failing")) return "";
  for (const auto& [words, hint] : kHints) {
    if (says(words)) return std::string(hint);
  }
  return "";
}

google::rpc::Status details_of(const grpc::Status& status) {
  google::rpc::Status details;
  // A status from an intermediary has no details of ours.
  if (!details.ParseFromString(status.error_details())) details.clear_details();
  details.set_code(status.error_code());
  details.set_message(status.error_message());
  return details;
}

}  // namespace

Error to_error(const grpc::Status& status) { return to_error(details_of(status)); }

Error to_error(const google::rpc::Status& status) {
  Error error;
  error.code = error_code_of(status.code());
  error.bound = status.message();
  if (error.code == ErrorCode::unavailable) error.bound += hint_of(error.bound);
  for (const auto& any : status.details()) {
    if (v1::Fault fault; any.UnpackTo(&fault)) {
      take_field(fault.field(), error);
      if (fault.has_index()) error.index = fault.index();
      error.value = fault.value();
      error.bound = fault.bound();
      return error;
    }
    google::rpc::BadRequest bad_request;  // from a server that does not know Fault
    if (!any.UnpackTo(&bad_request) || bad_request.field_violations().empty()) continue;
    take_field(bad_request.field_violations(0).field(), error);
    error.bound = bad_request.field_violations(0).description();
  }
  return error;
}

std::optional<std::chrono::duration<double>> retry_after(const google::rpc::Status& status) {
  if (error_code_of(status.code()) != ErrorCode::resource_exhausted) return std::nullopt;
  std::optional<std::chrono::duration<double>> delay;
  for (const auto& any : status.details()) {
    v1::Fault fault;
    if (any.UnpackTo(&fault) && is_too_large(fault)) return std::nullopt;
    google::rpc::RetryInfo info;
    if (any.UnpackTo(&info))
      delay = std::chrono::seconds(info.retry_delay().seconds()) +
              std::chrono::nanoseconds(info.retry_delay().nanos());
  }
  return delay;
}

std::optional<std::chrono::duration<double>> retry_after(const grpc::Status& status) {
  return retry_after(details_of(status));
}

Error to_error(const grpc::Status& status, const std::stop_token& stop) {
  Error error = to_error(status);
  if (error.code == ErrorCode::cancelled && stop.stop_requested()) error.bound = "cancelled by the caller";
  return error;
}

}  // namespace marble::client
