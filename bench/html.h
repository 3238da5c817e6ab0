// Pieces of self-contained HTML pages.
#pragma once

#include <string>

#include "absl/strings/string_view.h"
#include "base/image.h"

namespace tessera::bench {

// Up to and with the page's title; `</body></html>` ends it. `title` is plain text.
std::string page_head(absl::string_view title);
std::string escape(absl::string_view text);
std::string data_uri(absl::string_view type, absl::string_view bytes);
// The picture lies in the page itself, as JPEG.
std::string figure_html(const Image8& image, absl::string_view caption);

}  // namespace tessera::bench
