#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <nlohmann/json.hpp>
#include <random>
#include <regex>
#include <set>
#include <vector>

#include "http/array_routes.h"
#include "http/event_hub.h"
#include "http/event_routes.h"
#include "http/fleet_routes.h"
#include "http/gzip.h"
#include "http/health_routes.h"
#include "http/job_routes.h"
#include "http/metrics_route.h"
#include "http/page_assets.h"
#include "http/page_routes.h"
#include "http/request_head.h"
#include "http/submission_routes.h"
#include "server/idle_parts.h"

namespace marble::server::http {
namespace {

// Who takes answers packed, and that they come out as they went in.
std::string unpacked(std::string bytes, std::size_t most) {
  z_stream stream = {};
  EXPECT_EQ(inflateInit2(&stream, MAX_WBITS + 16), Z_OK);
  std::string result(most + 1, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(result.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  result.resize(stream.total_out);
  inflateEnd(&stream);
  return result;
}

TEST(Gzip, IsAcceptedByItsNameOrByAnyUnlessSomethingElseIsPreferred) {
  for (const char* field :
       {"gzip", "GZip", "x-gzip", "gzip;q=1", "gzip ; q=0.001", "gzip;Q=1.000", "deflate, gzip",
        "br;q=1.0,gzip;q=0.5", "*", "*;q=0.1", "identity;q=0.5, *;q=0.5", "identity;q=0, gzip;q=0.2",
        ", ,gzip,", " \tgzip\t ", "gzip, deflate, br, zstd", "gzip;q=0, gzip;q=0.5", "gzip;q=1."})
    EXPECT_TRUE(accepts_gzip(field)) << field;
}

TEST(Gzip, IsNotSentToWhoDoesNotAskForIt) {
  for (const char* field : {"", ",", "identity", "deflate", "gzip;q=0", "gzip;q=0.000", "*;q=0",
                            "gzip;q=0, *", "gzip;q=0.2, identity", "gzipped", "not-gzip", "gzip2, br"})
    EXPECT_FALSE(accepts_gzip(field)) << field;
}

TEST(Gzip, IsNotSentToWhoseFieldIsNone) {
  for (const char* field :
       {"gzip;q=",   "gzip;q=2",   "gzip;q=1.001", "gzip;q=-1",  "gzip;q=+1",    "gzip;q=0.5000",
        "gzip;q=.5", "gzip;q=nan", "gzip;q=1e0",   "gzip;q=0x1", "gzip;level=9", "gzip;",
        "gzip;;q=1", "gzip q=1",   "gzip;q=1;q=1", ";q=1",       "\"gzip\"",     "gz\x01ip",
        "gzip\xff",  "gzip/1",     "(gzip)",       "gzip;q=1 0"})
    EXPECT_FALSE(accepts_gzip(field)) << field;
  EXPECT_FALSE(accepts_gzip(std::string("gzip\0", 5)));
}

TEST(Gzip, ALongFieldIsReadOnce) {
  std::string field;
  for (int i = 0; i < 10'000; ++i) field += "a,;q=,";
  EXPECT_FALSE(accepts_gzip(field));
  EXPECT_FALSE(accepts_gzip(std::string(100'000, ';')));
  EXPECT_TRUE(accepts_gzip(std::string(100'000, ',') + "gzip"));
}

TEST(Gzip, BytesComeOutAsTheyWentIn) {
  std::mt19937 random(1);
  std::string noise(100'000, '\0');
  for (char& byte : noise) byte = static_cast<char>(random());
  for (const std::string& bytes : {std::string(), std::string("a"), std::string(1 << 20, 'x'), noise}) {
    const std::string packed = gzip(bytes);
    ASSERT_GE(packed.size(), 2u);
    EXPECT_EQ(packed.substr(0, 2), "\x1f\x8b");
    EXPECT_EQ(unpacked(packed, bytes.size()), bytes);
  }
  EXPECT_LT(gzip(std::string(1 << 20, 'x')).size(), 10'000u);
}

// Heads of requests that RFC 9112 refuses.
std::string head_with(const std::string& lines, const std::string& version = "HTTP/1.1") {
  return "POST /api/jobs " + version + "\r\nHost: localhost\r\n" + lines + "\r\n";
}

TEST(RequestHead, OneLengthOfDigitsOrOneChunkedEncodingIsValid) {
  for (const char* lines :
       {"", "Content-Length: 0\r\n", "content-length:128\r\n", "Content-Length: \t 128 \t\r\n",
        "CONTENT-LENGTH: 007\r\n", "Transfer-Encoding: chunked\r\n", "transfer-encoding: Chunked \r\n",
        "X-Other: a, b\r\nX-Other: c\r\n", "X-Empty:\r\n"})
    EXPECT_EQ(fault_of_head(head_with(lines)), "") << lines;
  EXPECT_EQ(fault_of_head(head_with("Content-Length: 5\r\n") + "a body\n\n:"), "")
      << "what follows is the body";
}

TEST(RequestHead, AnyOtherLengthIsInvalid) {
  for (const char* value :
       {"128, 128", "128,128", "+128", "-1", "", " ", "12 8", "0x10", "1e3", "128;", "1.0", "\"5\"",
        "9223372036854775808", "18446744073709551616", "99999999999999999999999", "five"}) {
    EXPECT_NE(
        fault_of_head(head_with("Content-Length: " + std::string(value) + "\r\n")).find("Content-Length"),
        std::string::npos)
        << value;
  }
  for (const char* lines :
       {"Content-Length: 5\r\nContent-Length: 6\r\n", "Content-Length: 5\r\nContent-Length: 5\r\n",
        "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\ncontent-length: 5\r\n"})
    EXPECT_NE(fault_of_head(head_with(lines)).find("Content-Length"), std::string::npos) << lines;
}

TEST(RequestHead, AnyOtherEncodingIsInvalid) {
  for (const char* value : {"", "gzip", "identity", "gzip, chunked", "chunked, chunked", "chunked, gzip",
                            "xchunked", "chunked;q=1", "\"chunked\"",
                            "\x0b"
                            "chunked"}) {
    EXPECT_NE(fault_of_head(head_with("Transfer-Encoding: " + std::string(value) + "\r\n"))
                  .find("Transfer-Encoding"),
              std::string::npos)
        << value;
  }
  EXPECT_NE(fault_of_head(head_with("Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n")), "");
  EXPECT_NE(fault_of_head(head_with("Transfer-Encoding: chunked\r\n", "HTTP/1.0")), "");
}

TEST(RequestHead, LinesThatHttplibPassesOverAreInvalid) {
  for (const char* lines : {"Content-Length : 5\r\n", " Content-Length: 5\r\n", "X: a\r\n folded\r\n",
                            "Content-Length\r\n", ": 5\r\n", "Content-Length: 5\n",
                            "X: a\rContent-Length: 5\r\n", "X(Y): 1\r\n", "Content\tLength: 5\r\n"})
    EXPECT_NE(fault_of_head(head_with(lines)), "") << lines;
  EXPECT_NE(fault_of_head(head_with(std::string("X: a\0b\r\n", 8))), "");
  EXPECT_NE(fault_of_head("GET / HTTP/1.1\nHost: localhost\r\n\r\n"), "");
  EXPECT_NE(fault_of_head("GET / HTTP/1.1\r\nHost: localhost"), "")
      << "it did not come in time, or is too long";
  EXPECT_NE(fault_of_head(""), "");
}

// The routes are those of the description that is served, server/http/openapi.json.
std::set<std::string> described() {
  std::set<std::string> routes;
  for (const PageAsset& asset : page_assets()) {
    if (asset.name != "openapi.json") continue;
    const auto description = nlohmann::json::parse(asset.bytes);
    for (const auto& [path, operations] : description.at("paths").items()) {
      for (const auto& [method, operation] : operations.items()) {
        std::string name = method == "get" ? "GET, HEAD" : method;
        std::transform(name.begin(), name.end(), name.begin(),
                       [](unsigned char c) { return std::toupper(c); });
        routes.insert(name + " " + path);
      }
    }
  }
  return routes;
}

TEST(Routes, AreThoseOfTheDescription) {
  IdleParts parts;
  httplib::Server server;
  Router router(server);
  Semaphore semaphore(1, 1);
  EventHub hub(parts.all, semaphore);
  add_health_routes(router, parts.all, {});
  add_job_routes(router, parts.all, semaphore);
  add_submission_routes(router, parts.all, semaphore);
  add_array_routes(router, parts.all, semaphore);
  add_event_routes(router, parts.all, hub);
  add_fleet_routes(router, parts.all);
  add_metrics_route(router, parts.all);
  add_page_routes(router);
  add_recent_routes(router, parts.all, begin_history(parts.all));
  std::set<std::string> routes;
  for (std::string route : router.routes()) {
    route = std::regex_replace(route, std::regex(R"(\(\[\^/\]\+\))"), "{job_id}");
    route = std::regex_replace(route, std::regex(R"(\\)"), "");
    const bool page = route == "GET, HEAD /" || route.starts_with("GET, HEAD /assets/");
    if (!page) routes.insert(route);
  }
  EXPECT_EQ(routes, described());
}

}  // namespace
}  // namespace marble::server::http
