#include "terminal/locale.h"

#include <langinfo.h>

#include <clocale>
#include <cstdlib>
#include <cstring>
#include <string>

namespace marble::cli {
namespace {

bool names_utf8(const char* locale) {
  return strcasestr(locale, "utf-8") != nullptr || strcasestr(locale, "utf8") != nullptr;
}

const char* asked_for() {
  for (const char* variable : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(variable);
    if (value != nullptr && *value != '\0') return value;
  }
  return "";
}

}  // namespace

bool set_terminal_locale() {
  if (std::setlocale(LC_CTYPE, "") == nullptr && names_utf8(asked_for())) std::setlocale(LC_CTYPE, "C.UTF-8");
  return std::strcmp(nl_langinfo(CODESET), "UTF-8") == 0;
}

}  // namespace marble::cli
