#pragma once

#include <string_view>

namespace tessera {

// As much of the text's beginning as is UTF-8 (RFC 3629), in whole characters; all of it is UTF-8 if that is
// all of it.
std::string_view utf8_prefix(std::string_view text);

}  // namespace tessera
