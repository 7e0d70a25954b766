# Writes page_assets.cpp from files: cmake -DOUTPUT=FILE -DASSETS=NAME=PATH;... -P page_assets.cmake
# A number a byte: string literals of any length are no standard C++.
set(table "")
set(arrays "")
set(index 0)
foreach(asset IN LISTS ASSETS)
  string(REGEX MATCH "^([^=]+)=(.+)$" matched "${asset}")
  set(name "${CMAKE_MATCH_1}")
  set(path "${CMAKE_MATCH_2}")
  file(READ "${path}" bytes HEX)
  file(SHA256 "${path}" hash)
  string(REGEX REPLACE "(................................)" "\\1\n" lines "${bytes}")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," lines "${lines}")
  string(APPEND arrays "constexpr unsigned char kBytes${index}[] = {\n${lines}0};\n")
  string(APPEND table "    asset(\"${name}\", kBytes${index}, \"${hash}\"),\n")
  math(EXPR index "${index} + 1")
endforeach()
file(WRITE "${OUTPUT}.part" "#include \"http/page_assets.h\"

namespace marble::server::http {
namespace {

${arrays}
// The last byte is a zero that an empty file needs.
template <std::size_t Size>
PageAsset asset(std::string_view name, const unsigned char (&bytes)[Size], std::string_view hash) {
  return {name, {reinterpret_cast<const char*>(bytes), Size - 1}, hash};
}

}  // namespace

std::span<const PageAsset> page_assets() {
  static const PageAsset kAssets[] = {
${table}  };
  return kAssets;
}

}  // namespace marble::server::http
")
file(RENAME "${OUTPUT}.part" "${OUTPUT}")
