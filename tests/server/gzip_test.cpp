// Who takes answers packed, and that they come out as they went in.
#include "http/gzip.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <random>

namespace marble::server::http {
namespace {

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

}  // namespace
}  // namespace marble::server::http
