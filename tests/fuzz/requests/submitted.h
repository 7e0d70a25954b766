// A submitted job's answer, waited for: its worker is another thread, its end the same every time.
#pragma once

#include <future>
#include <memory>
#include <string>

#include "service/service_parts.h"

namespace marble::fuzz {

[[nodiscard]] inline server::ResultStore::Shared wait_for_answer(const server::ServiceParts& parts,
                                                                 const std::string& id) {
  const auto promise = std::make_shared<std::promise<server::ResultStore::Shared>>();
  auto answer = promise->get_future();
  parts.results.wait(id, promise.get(),
                     [promise](const server::ResultStore::Shared& result) { promise->set_value(result); });
  return answer.get();
}

}  // namespace marble::fuzz
