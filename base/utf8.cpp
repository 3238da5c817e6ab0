#include "base/utf8.h"

#include <boost/locale/utf.hpp>

namespace tessera {

std::string_view utf8_prefix(std::string_view text) {
  namespace utf = boost::locale::utf;
  const char *good = text.data(), *const end = good + text.size();
  for (const char* next = good; next != end; good = next) {
    const utf::code_point c = utf::utf_traits<char>::decode(next, end);
    if (c == utf::illegal || c == utf::incomplete) break;
  }
  return text.substr(0, static_cast<size_t>(good - text.data()));
}

}  // namespace tessera
