// Pixels near borders between differently labelled pixels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera::bench {

// 1 where a pixel touches one of another label, left, right, above or below: it is within 1 px of the border.
std::vector<uint8_t> border_pixels(std::span<const uint32_t> labels, uint32_t width, uint32_t height);

// Whether a pixel or one of its eight neighbours is 1. Of border_pixels(): within 2 px of the border.
bool any_in_3x3(std::span<const uint8_t> mask, uint32_t width, uint32_t height, uint32_t x, uint32_t y);

}  // namespace tessera::bench
