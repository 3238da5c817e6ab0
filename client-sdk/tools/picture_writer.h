// Where tessera-client's pictures go.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "base/image.h"
#include "base/status.h"

namespace tessera::client {

class PictureWriter {
 public:
  virtual ~PictureWriter() = default;
  // `index` counts what was displayed. Pictures are all of one size. The file that holds this picture, or an
  // empty text.
  virtual StatusOr<std::string> write(const Image8& picture, uint64_t index) = 0;
  // Whether what was written is whole; call it last.
  virtual Status finish() { return absl::OkStatus(); }
  virtual uint64_t written() const = 0;
};

// `out` ends in .mp4: every picture becomes a frame of H.264, by the program ffmpeg. Otherwise it is a
// folder, where every n-th becomes a PNG, named by its index; as long as they fit into 256 MiB they are coded
// at the end only, so that they do not hold up what is displayed.
struct PictureSettings {
  std::string out;
  uint32_t save_every = 30;
  double fps = 60;
};
StatusOr<std::unique_ptr<PictureWriter>> make_picture_writer(const PictureSettings& settings);

}  // namespace tessera::client
