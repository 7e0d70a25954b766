#include "base/complaint.h"

#include <iostream>

#include "plain_text.h"

namespace marble::cli {

void complain(std::string_view what) { std::cerr << "marble: " << without_controls(what) << '\n'; }

void complain(std::string_view subject, std::string_view what) {
  std::cerr << "marble: " << without_controls(subject) << ": " << without_controls(what) << '\n';
}

}  // namespace marble::cli
