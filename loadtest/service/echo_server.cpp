#include "echo_server.h"

#include <cstdio>

#include "bench.h"

namespace marble::bench {
namespace {

// Uses the callback API, as the server does.
class Echo final : public v1::Solver::WithRawCallbackMethod_Solve<v1::Solver::Service> {
 public:
  explicit Echo(const std::string& answer) : slice_(answer) {}

 private:
  grpc::ServerUnaryReactor* Solve(grpc::CallbackServerContext* context, const grpc::ByteBuffer* /*request*/,
                                  grpc::ByteBuffer* response) override {
    *response = grpc::ByteBuffer(&slice_, 1);
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    reactor->Finish(grpc::Status::OK);
    return reactor;
  }

  const grpc::Slice slice_;
};

}  // namespace

EchoServer::EchoServer(const std::string& answer) {
  std::ofstream(folder_.file("answer"), std::ios::binary) << answer;
  const std::string self = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string folder = std::filesystem::path(folder_.file("answer")).parent_path().string();
  process_ = std::make_unique<testing::ChildProcess>(std::vector<std::string>{self, "--echo-server", folder},
                                                     folder_.file("log"));
  must(testing::eventually([&] { return std::filesystem::exists(folder_.file("addresses")); }),
       "the echo server did not start");
  std::ifstream lines(folder_.file("addresses"));
  for (std::string line; std::getline(lines, line);) addresses_.push_back(line);
}

int EchoServer::serve(const std::string& folder) {
  Echo echo(testing::read_file(folder + "/answer"));
  int port = 0;
  const std::string socket = "unix:" + folder + "/socket";
  grpc::ServerBuilder builder;
  builder.RegisterService(&echo);
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.AddListeningPort(socket, grpc::InsecureServerCredentials());
  const auto server = builder.BuildAndStart();
  if (server == nullptr) return 1;
  const std::string draft = folder + "/addresses.part";
  std::ofstream(draft) << "127.0.0.1:" << port << '\n' << socket << '\n';
  std::rename(draft.c_str(), (folder + "/addresses").c_str());
  server->Wait();  // until it is killed
  return 0;
}

}  // namespace marble::bench
