// Represents the server under load: its connections, and the metadata of every call.
#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>

#include <memory>
#include <string>
#include <vector>

#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::load {

using Stub = grpc::TemplatedGenericStub<grpc::ByteBuffer, grpc::ByteBuffer>;

class Target {
 public:
  /// Connects with the first calls. Errors: a bad address, files that cannot be read.
  [[nodiscard]] static Expected<Target> open(const std::string& address, const ConnectOptions& options,
                                             int connections);

  /// Returns the stub of client number `client`: clients are distributed round-robin.
  [[nodiscard]] Stub& stub(std::size_t client) const { return *stubs_[client % stubs_.size()]; }
  /// Sets the caller's name and the deadline; `deadline_s` 0 is none.
  void prepare(grpc::ClientContext& context, double deadline_s) const;
  [[nodiscard]] int connections() const { return static_cast<int>(stubs_.size()); }
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  Target() = default;
  std::string address_, authorization_, name_;
  std::vector<std::unique_ptr<Stub>> stubs_;
};

}  // namespace marble::load
