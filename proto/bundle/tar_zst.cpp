#include "tar_zst.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <vector>

namespace marble {
namespace {

constexpr std::size_t kBlock = 512;
constexpr std::size_t kNameBytes = 100;
// Fields of a header: where, and how many bytes.
struct Field {
  std::size_t at, bytes;
};
constexpr Field kMode{100, 8}, kOwner{108, 8}, kGroup{116, 8}, kSize{124, 12}, kTime{136, 12}, kSum{148, 8},
    kType{156, 1}, kMagic{257, 8};
constexpr std::string_view kUstar{"ustar\00000", 8};
using Header = std::array<char, kBlock>;

void set_octal(Header& header, Field field, std::uint64_t value) {
  char text[32];
  std::snprintf(text, sizeof text, "%0*llo", static_cast<int>(field.bytes - 1),
                static_cast<unsigned long long>(value));
  std::copy_n(text, field.bytes - 1, header.begin() + field.at);
}

// The sum of all bytes, those of the sum itself as spaces.
std::uint64_t sum_of(const Header& header) {
  std::uint64_t sum = kSum.bytes * ' ';
  for (std::size_t i = 0; i < kBlock; ++i) {
    if (i < kSum.at || i >= kSum.at + kSum.bytes) sum += static_cast<unsigned char>(header[i]);
  }
  return sum;
}

bool get_octal(const Header& header, Field field, std::uint64_t& value) {
  std::string_view text(header.data() + field.at, field.bytes);
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value, 8);
  const std::string_view rest = text.substr(static_cast<std::size_t>(end - text.data()));
  return fault == std::errc() && rest.find_first_not_of(std::string_view("\0 ", 2)) == std::string_view::npos;
}

std::uint64_t padding_of(std::uint64_t size) { return (kBlock - size % kBlock) % kBlock; }

Error damaged(const std::string& how) { return failure(ErrorCode::invalid_argument, "is no bundle: " + how); }

// What a compressed file unpacks to, in pieces of the size that is asked for.
class Unpacked {
 public:
  Unpacked(std::string_view file, std::uint64_t most_bytes)
      : context_(ZSTD_createDCtx()),
        input_{file.data(), file.size(), 0},
        most_(most_bytes),
        left_(most_bytes),
        window_(ZSTD_DStreamOutSize()) {}

  // Reports the next `count` bytes, piece by piece.
  template <class Report>
  [[nodiscard]] Expected<void> next(std::uint64_t count, const Report& report) {
    if (count > left_) {
      return unexpected(damaged("it would unpack to more than " + std::to_string(most_) +
                                " bytes, which is what a file of its size may"));
    }
    left_ -= count;
    while (count > 0) {
      if (at_ == end_) {
        MARBLE_RETURN_IF_ERROR(unpack());
        if (at_ == end_) return unexpected(damaged("it is cut off"));
      }
      const auto some = static_cast<std::size_t>(std::min<std::uint64_t>(count, end_ - at_));
      report(std::string_view(window_.data() + at_, some));
      at_ += some;
      count -= some;
    }
    return {};
  }
  // Passes over what follows the archive: zstd's sum of it all is at the end.
  [[nodiscard]] Expected<void> finish() {
    for (at_ = end_; end_ != 0;) {
      if (end_ > left_) return unexpected(damaged("too much follows the archive"));
      left_ -= end_;
      MARBLE_RETURN_IF_ERROR(unpack());
    }
    return {};
  }

 private:
  // Nothing at the end of a frame and of the file.
  [[nodiscard]] Expected<void> unpack() {
    ZSTD_outBuffer output{window_.data(), window_.size(), 0};
    at_ = end_ = 0;
    while (output.pos == 0) {
      if (frame_left_ == 0 && input_.pos == input_.size) return {};
      const std::size_t before = input_.pos;
      frame_left_ = ZSTD_decompressStream(context_.get(), &output, &input_);
      if (ZSTD_isError(frame_left_) != 0) return unexpected(damaged(ZSTD_getErrorName(frame_left_)));
      if (output.pos == 0 && input_.pos == before && frame_left_ != 0)
        return unexpected(damaged("it is cut off"));
    }
    end_ = output.pos;
    return {};
  }

  struct Free {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  const std::unique_ptr<ZSTD_DCtx, Free> context_;
  ZSTD_inBuffer input_;
  const std::uint64_t most_;
  std::uint64_t left_;
  std::size_t frame_left_ = 1;
  std::vector<char> window_;
  std::size_t at_ = 0, end_ = 0;
};

}  // namespace

TarZstWriter::TarZstWriter(Sink sink)
    : sink_(std::move(sink)), context_(ZSTD_createCCtx()), packed_(ZSTD_CStreamOutSize()) {
  ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, 1);
}

Expected<void> TarZstWriter::put(std::string_view bytes, ZSTD_EndDirective end) {
  ZSTD_inBuffer input{bytes.data(), bytes.size(), 0};
  std::size_t left = 1;
  while (end == ZSTD_e_end ? left > 0 : input.pos < input.size) {
    ZSTD_outBuffer output{packed_.data(), packed_.size(), 0};
    left = ZSTD_compressStream2(context_.get(), &output, &input, end);
    if (ZSTD_isError(left) != 0)
      return unexpected(failure(ErrorCode::internal, std::string("zstd: ") + ZSTD_getErrorName(left)));
    if (output.pos == 0) continue;
    MARBLE_RETURN_IF_ERROR(sink_({packed_.data(), output.pos}));
  }
  return {};
}

Expected<void> TarZstWriter::add(const std::string& name, std::uint64_t size, std::int64_t unix_s,
                                 const std::function<Expected<void>(const Report&)>& content) {
  Header header{};
  std::copy_n(name.begin(), std::min(name.size(), kNameBytes - 1), header.begin());
  set_octal(header, kMode, 0644);
  set_octal(header, kOwner, 0);
  set_octal(header, kGroup, 0);
  set_octal(header, kSize, size);
  set_octal(header, kTime, static_cast<std::uint64_t>(std::max<std::int64_t>(0, unix_s)));
  header[kType.at] = '0';
  std::copy(kUstar.begin(), kUstar.end(), header.begin() + kMagic.at);
  set_octal(header, {kSum.at, kSum.bytes - 1}, sum_of(header));
  header[kSum.at + kSum.bytes - 1] = ' ';
  MARBLE_RETURN_IF_ERROR(put({header.data(), header.size()}));
  if (auto reported = content([this](std::string_view bytes) { return put(bytes); }); !reported)
    return reported;
  const std::string padding(padding_of(size), '\0');
  return put(padding);
}

Expected<void> TarZstWriter::finish() { return put(std::string(2 * kBlock, '\0'), ZSTD_e_end); }

Expected<void> read_tar_zst(
    std::string_view file, std::uint64_t most_bytes,
    const std::function<Expected<TarTake>(std::string_view name, std::uint64_t size)>& ask,
    const std::function<void(std::string_view name, std::string content)>& take) {
  Unpacked unpacked(file, most_bytes);
  while (true) {
    Header header{};
    std::size_t at = 0;
    const auto fill = [&](std::string_view bytes) {
      std::copy(bytes.begin(), bytes.end(), header.begin() + at);
      at += bytes.size();
    };
    MARBLE_RETURN_IF_ERROR(unpacked.next(kBlock, fill));
    if (std::ranges::all_of(header, [](char c) { return c == '\0'; })) return unpacked.finish();
    std::uint64_t sum = 0, size = 0;
    if (!get_octal(header, kSum, sum) || sum != sum_of(header) || !get_octal(header, kSize, size))
      return unexpected(damaged("it is no tar archive, or damaged"));
    const std::string_view name(header.data(), strnlen(header.data(), kNameBytes));
    TarTake how = TarTake::skip;
    if (header[kType.at] == '0' || header[kType.at] == '\0') {
      MARBLE_ASSIGN_OR_RETURN(how, ask(name, size));
    }
    std::string content;
    const auto keep = [&](std::string_view bytes) {
      if (how == TarTake::keep) content.append(bytes);
    };
    MARBLE_RETURN_IF_ERROR(unpacked.next(size, keep));
    MARBLE_RETURN_IF_ERROR(unpacked.next(padding_of(size), [](std::string_view) {}));
    if (how == TarTake::keep) take(name, std::move(content));
  }
}

}  // namespace marble
