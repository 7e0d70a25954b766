// A client to be killed: has the server busy with a solve that takes for ever, and says "running" once it is.
// Usage: stream_client ADDRESS [stream | proof | batch | session]
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <iostream>
#include <string>

#include "marble/v1/service.grpc.pb.h"
#include "problems.h"

namespace {

using namespace marble;

constexpr int kBatch = 8;

grpc::Status stream(v1::Solver::Stub& stub, grpc::ClientContext& context, const v1::SolveRequest& solve,
                    bool (*runs)(const v1::Progress&)) {
  v1::SolveStreamRequest request;
  *request.mutable_solve() = solve;
  const auto reader = stub.SolveStream(&context, request);
  bool reported = false;
  for (v1::SolveStreamResponse event; reader->Read(&event);) {
    if (reported || !std::ranges::any_of(event.progress().rows(), runs)) continue;
    std::cout << "running" << std::endl;
    reported = true;
  }
  return reader->Finish();
}

bool iterates(const v1::Progress& /*row*/) { return true; }
bool has_a_tree(const v1::Progress& row) { return row.open_nodes() > 1; }

grpc::Status batch(v1::Solver::Stub& stub, grpc::ClientContext& context) {
  const auto stream = stub.SolveBatch(&context);
  v1::SolveBatchRequest request;
  *request.mutable_solve() = testing::long_request();
  for (int tag = 0; tag < kBatch; ++tag) {
    request.set_tag(tag);
    stream->Write(request);
  }
  std::cout << "running" << std::endl;
  for (v1::SolveBatchResponse response; stream->Read(&response);) {
  }
  return stream->Finish();
}

grpc::Status session(v1::Solver::Stub& stub, grpc::ClientContext& context) {
  const auto stream = stub.Session(&context);
  v1::SolveRequest solve = testing::long_request();
  v1::SessionRequest request;
  request.mutable_setup()->mutable_problem()->Swap(solve.mutable_problem());
  request.mutable_setup()->mutable_options()->Swap(solve.mutable_options());
  request.mutable_setup()->set_progress(true);
  stream->Write(request);
  request.mutable_update()->set_sequence(1);
  stream->Write(request);
  bool reported = false;
  for (v1::SessionResponse response; stream->Read(&response);) {
    if (response.has_progress() && !reported) std::cout << "running" << std::endl;
    reported = reported || response.has_progress();
  }
  return stream->Finish();
}

}  // namespace

int main(int argc, char** argv) {
  const std::string kind = argc == 3 ? argv[2] : "stream";
  if (argc < 2 || argc > 3 || (kind != "stream" && kind != "proof" && kind != "batch" && kind != "session"))
    return 2;
  const auto channel = grpc::CreateChannel(argv[1], grpc::InsecureChannelCredentials());
  const auto stub = v1::Solver::NewStub(channel);
  grpc::ClientContext context;
  const grpc::Status status = kind == "session" ? session(*stub, context)
                              : kind == "batch" ? batch(*stub, context)
                              : kind == "proof" ? stream(*stub, context, testing::long_proof(), has_a_tree)
                                                : stream(*stub, context, testing::long_request(), iterates);
  std::cout << "ended: " << status.error_message() << std::endl;
  return status.ok() ? 0 : 1;
}
