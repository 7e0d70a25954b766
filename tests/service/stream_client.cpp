// A client to be killed: streams a long solve and says "running" once progress comes.
#include <grpcpp/grpcpp.h>

#include <iostream>

#include "marble/v1/service.grpc.pb.h"
#include "problems.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto channel = grpc::CreateChannel(argv[1], grpc::InsecureChannelCredentials());
  const auto stub = marble::v1::Solver::NewStub(channel);
  grpc::ClientContext context;
  marble::v1::SolveStreamRequest request;
  *request.mutable_solve() = marble::testing::long_request();
  const auto reader = stub->SolveStream(&context, request);
  bool told = false;
  for (marble::v1::SolveStreamResponse event; reader->Read(&event);) {
    if (event.has_progress() && !told) std::cout << "running" << std::endl;
    told = told || event.has_progress();
  }
  const grpc::Status status = reader->Finish();
  std::cout << "ended: " << status.error_message() << std::endl;
  return status.ok() ? 0 : 1;
}
