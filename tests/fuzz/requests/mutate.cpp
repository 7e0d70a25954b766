#include "requests/mutate.h"

#include <google/protobuf/any.pb.h>
#include <google/protobuf/descriptor.h>

#include <memory>
#include <string>
#include <vector>

namespace marble::fuzz {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

struct Site {
  Message* message;
  const FieldDescriptor* field;
};

// Every field, of messages that are there; one that is set counts thrice.
void collect(Message& message, std::vector<Site>& sites) {
  const auto& fields = *message.GetDescriptor();
  const auto& reflection = *message.GetReflection();
  for (int k = 0; k < fields.field_count(); ++k) {
    const FieldDescriptor* field = fields.field(k);
    const bool is_set =
        field->is_repeated() ? reflection.FieldSize(message, field) > 0 : reflection.HasField(message, field);
    sites.insert(sites.end(), is_set ? 3 : 1, {&message, field});
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE || !is_set) continue;
    if (!field->is_repeated()) {
      collect(*reflection.MutableMessage(&message, field), sites);
      continue;
    }
    for (int i = 0; i < reflection.FieldSize(message, field); ++i)
      collect(*reflection.MutableRepeatedMessage(&message, field, i), sites);
  }
}

double number(double old, Draw& draw) {
  switch (draw.between(0, 9)) {
    case 0:
      return -old;
    case 1:
      return old + 1.0;
    case 2:
      return 0.5 * old;
    case 3:
    case 4:
      return draw.hostile();
    default:
      return draw.friendly();
  }
}

std::int64_t integer(std::int64_t old, Draw& draw) {
  switch (draw.between(0, 4)) {
    case 0:
      return draw.hostile_integer();
    case 1:
      return static_cast<std::int64_t>(static_cast<std::uint64_t>(old) + 1);
    case 2:
      return static_cast<std::int64_t>(static_cast<std::uint64_t>(old) - 1);
    default:
      return draw.between(0, 6);
  }
}

std::string text(std::string old, Draw& draw) {
  const std::size_t at = draw.below(old.size() + 1);
  switch (draw.between(0, 5)) {
    case 0:
      return "";
    case 1:
      return old.substr(0, at);
    case 2:
      return old + old;
    case 3:
      return old.insert(at, 1, static_cast<char>(draw.between(0, 255)));
    case 4:
      return old.insert(at, static_cast<std::size_t>(draw.between(1, 300)), 'x');
    default:
      return std::to_string(draw.between(0, 3));
  }
}

#define MARBLE_NUMERIC_KINDS(KIND)                                                                \
  KIND(DOUBLE, Double, number(old, draw))                                                         \
  KIND(FLOAT, Float, static_cast<float>(number(static_cast<double>(old), draw)))                  \
  KIND(INT32, Int32, static_cast<std::int32_t>(integer(old, draw)))                               \
  KIND(INT64, Int64, integer(old, draw))                                                          \
  KIND(UINT32, UInt32, static_cast<std::uint32_t>(integer(old, draw)))                            \
  KIND(UINT64, UInt64, static_cast<std::uint64_t>(integer(static_cast<std::int64_t>(old), draw))) \
  KIND(BOOL, Bool, !old)                                                                          \
  KIND(STRING, String, text(old, draw))                                                           \
  KIND(ENUM, EnumValue, draw.between(-1, 12))

void change_single(const Site& site, Draw& draw) {
  const auto& reflection = *site.message->GetReflection();
  if (draw.chance(15)) return reflection.ClearField(site.message, site.field);
  switch (site.field->cpp_type()) {
#define MARBLE_KIND(type, name, value)                                                 \
  case FieldDescriptor::CPPTYPE_##type: {                                              \
    [[maybe_unused]] const auto old = reflection.Get##name(*site.message, site.field); \
    return reflection.Set##name(site.message, site.field, value);                      \
  }
    MARBLE_NUMERIC_KINDS(MARBLE_KIND)
#undef MARBLE_KIND
    case FieldDescriptor::CPPTYPE_MESSAGE:
      reflection.MutableMessage(site.message, site.field);
  }
}

void add_entry(const Site& site, Draw& draw) {
  const auto& reflection = *site.message->GetReflection();
  switch (site.field->cpp_type()) {
#define MARBLE_KIND(type, name, value)                                                         \
  case FieldDescriptor::CPPTYPE_##type: {                                                      \
    [[maybe_unused]] const decltype(reflection.Get##name(*site.message, site.field)) old = {}; \
    return reflection.Add##name(site.message, site.field, value);                              \
  }
    MARBLE_NUMERIC_KINDS(MARBLE_KIND)
#undef MARBLE_KIND
    case FieldDescriptor::CPPTYPE_MESSAGE: {
      const int size = reflection.FieldSize(*site.message, site.field);
      Message* added = reflection.AddMessage(site.message, site.field);
      if (size == 0) return;
      const int like = static_cast<int>(draw.below(static_cast<std::size_t>(size)));
      added->CopyFrom(reflection.GetRepeatedMessage(*site.message, site.field, like));
    }
  }
}

void change_entry(const Site& site, int at, Draw& draw) {
  const auto& reflection = *site.message->GetReflection();
  switch (site.field->cpp_type()) {
#define MARBLE_KIND(type, name, value)                                                             \
  case FieldDescriptor::CPPTYPE_##type: {                                                          \
    [[maybe_unused]] const auto old = reflection.GetRepeated##name(*site.message, site.field, at); \
    return reflection.SetRepeated##name(site.message, site.field, at, value);                      \
  }
    MARBLE_NUMERIC_KINDS(MARBLE_KIND)
#undef MARBLE_KIND
    case FieldDescriptor::CPPTYPE_MESSAGE:
      if (draw.chance(30)) reflection.MutableRepeatedMessage(site.message, site.field, at)->Clear();
  }
}

void change_repeated(const Site& site, Draw& draw) {
  const auto& reflection = *site.message->GetReflection();
  const int size = reflection.FieldSize(*site.message, site.field);
  if (size == 0) return add_entry(site, draw);
  const int at = static_cast<int>(draw.below(static_cast<std::size_t>(size)));
  switch (draw.between(0, 19)) {
    case 0:
      return reflection.ClearField(site.message, site.field);
    case 1:
      return reflection.RemoveLast(site.message, site.field);
    case 2:
      return add_entry(site, draw);
    case 3:
    case 4:
      return reflection.SwapElements(site.message, site.field, at,
                                     static_cast<int>(draw.below(static_cast<std::size_t>(size))));
    default:
      return change_entry(site, at, draw);
  }
}

// What an Any holds, changed as its own kind of message.
bool mutate_within(google::protobuf::Any& any, Draw& draw) {
  const std::string name = any.type_url().substr(any.type_url().find('/') + 1);
  const auto* type = google::protobuf::DescriptorPool::generated_pool()->FindMessageTypeByName(name);
  const Message* prototype =
      type == nullptr ? nullptr : google::protobuf::MessageFactory::generated_factory()->GetPrototype(type);
  if (prototype == nullptr) return false;
  const std::unique_ptr<Message> held(prototype->New());
  if (!held->ParseFromString(any.value())) return false;
  mutate(*held, draw);
  any.PackFrom(*held);
  return true;
}

}  // namespace

void mutate(Message& message, Draw& draw) {
  std::vector<Site> sites;
  collect(message, sites);
  if (sites.empty()) return;
  const Site site = sites[draw.below(sites.size())];
  if (auto* any = dynamic_cast<google::protobuf::Any*>(site.message); any != nullptr) {
    if (mutate_within(*any, draw)) return;
  }
  if (site.field->is_repeated()) return change_repeated(site, draw);
  change_single(site, draw);
}

}  // namespace marble::fuzz
