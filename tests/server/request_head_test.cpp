// Heads of requests that RFC 9112 refuses.
#include "http/request_head.h"

#include <gtest/gtest.h>

#include <vector>

namespace marble::server::http {
namespace {

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

}  // namespace
}  // namespace marble::server::http
