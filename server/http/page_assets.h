// The files of server/page, compiled in: page_assets.cmake generates page_assets.cpp from them.
#pragma once

#include <span>
#include <string_view>

namespace marble::server::http {

struct PageAsset {
  std::string_view name;  ///< "index.html"
  std::string_view bytes;
  std::string_view hash;  ///< hash of the bytes, in hexadecimal
};

[[nodiscard]] std::span<const PageAsset> page_assets();

}  // namespace marble::server::http
