#include "marble/solution.h"

namespace marble {

const char* to_string(Status status) {
  switch (status) {
#define MARBLE_STATUS(name, ...) \
  case Status::name:             \
    return #name;
#include "marble/contract.def"
  }
  return "unknown";
}

const char* advice(Status status) {
  switch (status) {
#define MARBLE_STATUS(name, tone, means, advice) \
  case Status::name:                             \
    return advice;
#include "marble/contract.def"
  }
  return "";
}

const char* to_string(Stationarity stationarity) {
  switch (stationarity) {
    case Stationarity::unknown:
      break;
    case Stationarity::weak:
      return "weak";
    case Stationarity::clarke:
      return "clarke";
    case Stationarity::mordukhovich:
      return "mordukhovich";
    case Stationarity::strong:
      return "strong";
  }
  return "unknown";
}

const char* to_string(PointOrigin origin) { return origin == PointOrigin::previous ? "previous" : "solve"; }

const char* to_string(SecondOrder second_order) {
  switch (second_order) {
    case SecondOrder::unknown:
      break;
    case SecondOrder::saddle:
      return "saddle";
    case SecondOrder::necessary:
      return "necessary";
    case SecondOrder::minimum:
      return "minimum";
    case SecondOrder::convex:
      return "convex";
  }
  return "unknown";
}

}  // namespace marble
