// Which quantiser scale makes a JPEG of a given size, from what the pictures before have taken.
#pragma once

namespace tessera::codec {

// Near any scale, size = c * scale^-e; e changes slowly, c with the picture.
class ScaleSearch {
 public:
  // `bits_per_mcu` > 0; within kFinestScale..kCoarsestScale.
  double scale_for(double bits_per_mcu) const;
  // The inverse: what is to be expected of a scale.
  double bits_per_mcu(double scale) const;
  // What a picture took with a scale; the next guess passes through here. `same_picture`: as the one before.
  void learn(double scale, double bits_per_mcu, bool same_picture);

 private:
  double scale_ = 1, bits_per_mcu_ = 150;  // typical of atlases
  double exponent_ = 0.75;                 // likewise
};

}  // namespace tessera::codec
