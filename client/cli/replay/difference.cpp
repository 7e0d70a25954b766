#include "replay/difference.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>

namespace marble::cli {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Memory depends on the server's limits.
constexpr std::array<std::string_view, 5> kOfARun = {"times", "options", "elapsed_s", "seconds",
                                                     "memory_bytes"};

std::string text_of(double value) {
  std::array<char, 40> digits;
  return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

bool is_same(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

class Comparison {
 public:
  std::vector<Difference> found;

  void compare(const Message& before, const Message& now, const std::string& path) {
    const auto* descriptor = before.GetDescriptor();
    for (int i = 0; i < descriptor->field_count(); ++i) {
      const FieldDescriptor* field = descriptor->field(i);
      if (std::ranges::find(kOfARun, field->name()) != kOfARun.end()) continue;
      const std::string name = path.empty() ? field->name() : path + "." + field->name();
      if (field->is_repeated()) {
        compare_entries(before, now, field, name);
      } else {
        compare_single(before, now, field, name);
      }
    }
  }

 private:
  void note(const std::string& field, std::int64_t index, std::string before, std::string now) {
    found.push_back({field, index, std::move(before), std::move(now)});
  }

  void compare_single(const Message& before, const Message& now, const FieldDescriptor* field,
                      const std::string& name) {
    const Reflection* access = before.GetReflection();
    if (field->has_presence()) {
      const bool had = access->HasField(before, field), has = access->HasField(now, field);
      if (had != has) return note(name, -1, had ? "there" : "absent", has ? "there" : "absent");
      if (!had) return;
    }
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE)
      return compare(access->GetMessage(before, field), access->GetMessage(now, field), name);
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
      const double a = access->GetDouble(before, field), b = access->GetDouble(now, field);
      if (is_same(a, b)) return;
      note(name, -1, text_of(a), text_of(b));
      found.back().largest = std::abs(a - b);
      return;
    }
    const std::string a = word_of(before, field), b = word_of(now, field);
    if (a != b) note(name, -1, a, b);
  }

  static std::string word_of(const Message& message, const FieldDescriptor* field) {
    const Reflection* access = message.GetReflection();
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_ENUM:
        return access->GetEnum(message, field)->name();
      case FieldDescriptor::CPPTYPE_STRING:
        return access->GetString(message, field);
      case FieldDescriptor::CPPTYPE_BOOL:
        return access->GetBool(message, field) ? "true" : "false";
      case FieldDescriptor::CPPTYPE_INT32:
        return std::to_string(access->GetInt32(message, field));
      case FieldDescriptor::CPPTYPE_INT64:
        return std::to_string(access->GetInt64(message, field));
      case FieldDescriptor::CPPTYPE_UINT32:
        return std::to_string(access->GetUInt32(message, field));
      case FieldDescriptor::CPPTYPE_UINT64:
        return std::to_string(access->GetUInt64(message, field));
      case FieldDescriptor::CPPTYPE_FLOAT:
        return text_of(static_cast<double>(access->GetFloat(message, field)));
      default:
        return {};
    }
  }

  void compare_entries(const Message& before, const Message& now, const FieldDescriptor* field,
                       const std::string& name) {
    const Reflection* access = before.GetReflection();
    const int count = access->FieldSize(before, field);
    if (count != access->FieldSize(now, field)) {
      return note(name, -1, std::to_string(count) + " entries",
                  std::to_string(access->FieldSize(now, field)) + " entries");
    }
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      for (int k = 0; k < count; ++k)
        compare(access->GetRepeatedMessage(before, field, k), access->GetRepeatedMessage(now, field, k),
                name + "[" + std::to_string(k) + "]");
      return;
    }
    Difference all{.field = name, .entries = 0};
    for (int k = 0; k < count; ++k) {
      std::string a, b;
      if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
        const double x = access->GetRepeatedDouble(before, field, k),
                     y = access->GetRepeatedDouble(now, field, k);
        if (is_same(x, y)) continue;
        if (std::isfinite(x - y)) all.largest = std::max(all.largest, std::abs(x - y));
        a = text_of(x), b = text_of(y);
      } else {
        const auto x = integer_of(before, field, k), y = integer_of(now, field, k);
        if (x == y) continue;
        a = std::to_string(x), b = std::to_string(y);
      }
      if (all.entries++ == 0) all.index = k, all.before = a, all.now = b;
    }
    if (all.entries > 0) found.push_back(all);
  }

  static std::int64_t integer_of(const Message& message, const FieldDescriptor* field, int k) {
    const Reflection* access = message.GetReflection();
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_INT32:
        return access->GetRepeatedInt32(message, field, k);
      case FieldDescriptor::CPPTYPE_INT64:
        return access->GetRepeatedInt64(message, field, k);
      case FieldDescriptor::CPPTYPE_BOOL:
        return access->GetRepeatedBool(message, field, k) ? 1 : 0;
      case FieldDescriptor::CPPTYPE_ENUM:
        return access->GetRepeatedEnumValue(message, field, k);
      default:
        return 0;
    }
  }
};

// Returns the position of row `k` of a trace among all rows; -1 if it is unknown.
std::int64_t place_of(const v1::Trace& trace, int k, bool finished, std::int64_t rows) {
  const std::int64_t stride = std::max(1, trace.stride()), at = k * stride;
  if (k + 1 < trace.rows_size() || stride == 1) return at;
  return finished ? std::min(at, rows - 1) : -1;  // the newest may be between two that are kept
}

}  // namespace

std::vector<Difference> differences(const v1::Solution& before, const v1::Solution& now) {
  Comparison comparison;
  comparison.compare(before, now, "");
  return comparison.found;
}

std::vector<Difference> differences(const v1::Trace& before, bool finished,
                                    const std::vector<v1::Progress>& rows) {
  const auto count = static_cast<std::int64_t>(rows.size());
  const std::int64_t stride = std::max(1, before.stride());
  std::vector<Difference> found;
  for (int k = 0; k < before.rows_size(); ++k) {
    const std::int64_t at = place_of(before, k, finished, count);
    if (at < 0 || at >= count) continue;
    Comparison comparison;
    comparison.compare(before.rows(k), rows[static_cast<std::size_t>(at)], "trace");
    for (Difference& one : comparison.found) {
      const auto same = std::ranges::find(found, one.field, &Difference::field);
      if (same != found.end()) {
        ++same->entries;
        same->largest = std::max(same->largest, one.largest);
        continue;
      }
      one.index = at;
      found.push_back(std::move(one));
    }
  }
  const std::int64_t kept = before.rows_size();
  // With a stride, the last row may have any distance from the one before.
  const std::int64_t least = (kept - 2) * stride + 2, most = (kept - 1) * stride + 1;
  const bool fits = count >= std::min(least, most) && (count <= most || !finished);
  if (kept > 0 && !fits)
    found.push_back({"trace", -1, std::to_string(most) + " rows" + (stride > 1 ? " at most" : ""),
                     std::to_string(count) + " rows"});
  return found;
}

}  // namespace marble::cli
