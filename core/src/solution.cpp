#include "marble/solution.h"

namespace marble {

const char* to_string(Status status) {
  switch (status) {
    case Status::solved:
      return "solved";
    case Status::solved_reduced:
      return "solved_reduced";
    case Status::iteration_limit:
      return "iteration_limit";
    case Status::time_limit:
      return "time_limit";
    case Status::cancelled:
      return "cancelled";
    case Status::infeasible:
      return "infeasible";
    case Status::locally_infeasible:
      return "locally_infeasible";
    case Status::unbounded:
      return "unbounded";
    case Status::numerical_failure:
      return "numerical_failure";
  }
  return "unknown";
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
  }
  return "unknown";
}

}  // namespace marble
