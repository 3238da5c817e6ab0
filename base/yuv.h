// 4:2:0 video frames on the CPU.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// I420: three planes without padding; BT.709, limited ("TV") range. Width and height are even. Chroma is
// sited at the centre of each 2x2 square of luma, so that a 2-aligned block owns its chroma samples.
struct YuvImage {
  uint32_t width = 0, height = 0;
  std::vector<uint8_t> y, u, v;
};

// A view of I420 planes that somebody else owns (a mapped readback buffer, a decoder's frame). Strides in
// bytes.
struct YuvView {
  uint32_t width = 0, height = 0;
  const uint8_t* y = nullptr;
  const uint8_t* u = nullptr;
  const uint8_t* v = nullptr;
  uint32_t y_stride = 0, uv_stride = 0;
};

}  // namespace tessera
