// Any bytes as a meta packet. What decodes must be valid: it encodes again, to a packet that decodes to the
// same.
#include <cstdlib>

#include "geometry-compression/meta_codec.h"

namespace gc = tessera::geometry_compression;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // Counts that a small input can pay for, so that a run of zeros does not make every input slow.
  constexpr gc::MetaLimits kLimits{
      .max_vertices = 1u << 14, .max_objects = 1u << 12, .max_patches = 1u << 14};
  gc::MetaFrame frame;
  if (!gc::decode({data, size}, frame, kLimits).empty()) return 0;
  gc::MetaFrame again;
  if (!gc::decode(gc::encode(frame), again, kLimits).empty() || !(again == frame)) std::abort();
  return 0;
}
