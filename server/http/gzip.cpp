#include "http/gzip.h"

#include <zlib.h>

#include <algorithm>
#include <limits>
#include <optional>

#include "http/field_text.h"

namespace marble::server::http {
namespace {

constexpr int kThousandths = 1000;
constexpr std::size_t kMostDigits = 3;       // digits of a weight after its point
constexpr int kGzipWindow = MAX_WBITS + 16;  // zlib's parameter for the gzip format

// In thousandths, or empty if invalid: "1", "0.5", "1.000".
std::optional<int> weight_of(std::string_view text) {
  if (text.empty() || (text[0] != '0' && text[0] != '1')) return std::nullopt;
  int weight = (text[0] - '0') * kThousandths;
  std::string_view digits = text.substr(1);
  if (digits.empty()) return weight;
  if (digits[0] != '.' || digits.size() > 1 + kMostDigits) return std::nullopt;
  digits.remove_prefix(1);
  int unit = kThousandths;
  for (const char digit : digits) {
    if (digit < '0' || digit > '9') return std::nullopt;
    weight += (digit - '0') * (unit /= 10);
  }
  return weight <= kThousandths ? std::optional(weight) : std::nullopt;
}

}  // namespace

bool accepts_gzip(std::string_view accept_encoding) {
  std::optional<int> gzip, identity, others;
  for (std::string_view rest = accept_encoding; !rest.empty();) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    const std::string_view element = trimmed(rest.substr(0, comma));
    rest.remove_prefix(std::min(comma + 1, rest.size()));
    if (element.empty()) continue;
    const std::size_t semicolon = std::min(element.find(';'), element.size());
    const std::string_view coding = trimmed(element.substr(0, semicolon));
    int weight = kThousandths;
    if (semicolon < element.size()) {
      const std::string_view parameter = trimmed(element.substr(semicolon + 1));
      if (!equal(parameter.substr(0, 2), "q=")) return false;
      const std::optional<int> given = weight_of(parameter.substr(2));
      if (!given) return false;
      weight = *given;
    }
    if (!is_token(coding)) return false;
    std::optional<int>* known = nullptr;
    if (equal(coding, "gzip") || equal(coding, "x-gzip")) known = &gzip;
    if (equal(coding, "identity")) known = &identity;
    if (coding == "*") known = &others;
    if (known != nullptr) *known = std::max(known->value_or(0), weight);
  }
  const int request = gzip.value_or(others.value_or(0));
  return request > 0 && request >= identity.value_or(0);
}

std::string gzip(std::string_view bytes) {
  if (bytes.size() > std::numeric_limits<uInt>::max()) return "";
  z_stream stream = {};
  if (deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, kGzipWindow, MAX_MEM_LEVEL, Z_DEFAULT_STRATEGY) != Z_OK)
    return "";
  std::string packed(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return result == Z_STREAM_END ? packed : "";
}

}  // namespace marble::server::http
