// A request to solve as JSON on its way through the HTTP port: submitted, worked off, and asked for on every
// route that a job has. The answer's JSON is the message that a gRPC client would read, bit for bit.
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/util/json_util.h>

#include "base/wire.h"
#include "expect.h"
#include "http/reply.h"
#include "http_port.h"
#include "marble/convert.h"
#include "problem_json.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/submitted.h"

using namespace marble;

namespace {

// A problem that is none is written as far as that goes; so is a number that JSON does not have.
std::string json_of(const v1::SolveRequest& request) {
  std::string text = "{";
  if (has_problem(request)) {
    text += "\"problem\":";
    const auto written = write_problem_json(request, [&text](std::string_view piece) -> Expected<void> {
      text += piece;
      return {};
    });
    FUZZ_EXPECT(written.has_value());
  }
  v1::SolveRequest rest = request;
  if (has_problem(request)) rest.clear_problem();
  std::string members;
  FUZZ_EXPECT(google::protobuf::util::MessageToJsonString(rest, &members).ok());
  const std::string_view inner(members.data() + 1, members.size() - 2);
  if (text.size() > 1 && !inner.empty()) text += ",";
  return text + std::string(inner) + "}";
}

std::string request_of(const std::string& line, const std::string& body = "") {
  const std::string type = body.empty() ? "" : "Content-Type: application/json\r\n";
  return line + " HTTP/1.1\r\nHost: localhost\r\n" + type + "Content-Length: " + std::to_string(body.size()) +
         "\r\n\r\n" + body;
}

std::string body_of(const std::string& answer) {
  const std::size_t end = answer.find("\r\n\r\n");
  FUZZ_EXPECT(end != std::string::npos);
  return answer.substr(end + 4);
}

bool is(const std::string& answer, const char* status) {
  return answer.starts_with(std::string("HTTP/1.1 ") + status);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<v1::SolveRequest>(data, size, most, seed, fuzz::make_any_solve);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static fuzz::HttpPort port(1 << 20, 1 << 20);
    v1::SolveRequest request;
    if (!request.ParseFromArray(data, static_cast<int>(size))) return;
    fuzz::limit_budgets(&request);
    const std::string submitted = port.answer(request_of("POST /api/jobs", json_of(request)));
    FUZZ_EXPECT(!is(submitted, "5"));
    v1::SubmitResponse place;
    if (!is(submitted, "202")) {
      FUZZ_EXPECT(is(submitted, "4"));
      FUZZ_EXPECT(submitted.find("\"error\"") != std::string::npos);
      return;
    }
    FUZZ_EXPECT(google::protobuf::util::JsonStringToMessage(body_of(submitted), &place).ok());
    const auto result = fuzz::wait_for_answer(port.all, place.job_id());
    FUZZ_EXPECT(result != nullptr);
    const std::string job = "/api/jobs/" + place.job_id();
    const std::string answered = port.answer(request_of("GET " + job + "/result"));
    if (!result->answer) {
      fuzz::expect_sound(result->answer.error());
      FUZZ_EXPECT(answered.find("\"error\"") != std::string::npos);
    } else if (answered.size() < (100 << 10)) {  // else it is cut off by the socket
      FUZZ_EXPECT(is(answered, "200"));
      v1::SolveResponse read, kept;
      FUZZ_EXPECT(google::protobuf::util::JsonStringToMessage(body_of(answered), &read).ok());
      grpc::ByteBuffer bytes(*result->answer);
      FUZZ_EXPECT(server::parse(&bytes, &kept, 100000).has_value());
      // protobuf reads -0 as 0: the texts are compared.
      FUZZ_EXPECT(body_of(answered) == server::http::to_json(kept));
      fuzz::expect_sound(read.solution());
    }
    for (const char* line : {"GET /api/jobs?state=finished&limit=1", "GET /metrics", "GET /api/info",
                             "GET /api/events", "GET /healthz"})
      FUZZ_EXPECT(is(port.answer(request_of(line)), "200"));
    FUZZ_EXPECT(is(port.answer(request_of("GET " + job + "/results?after=1")), "404"));  // no array
    for (const char* part : {"", "/trace.csv", "/bundle", "/events"}) {
      FUZZ_EXPECT(is(port.answer(request_of("GET " + job + part)), "200"));
    }
    FUZZ_EXPECT(is(port.answer(request_of("POST " + job + "/cancel", "{}")), "200"));
    FUZZ_EXPECT(is(port.answer(request_of("DELETE " + job)), "200"));
    FUZZ_EXPECT(is(port.answer(request_of("GET " + job)), "404"));
  });
}
