// A recorded camera path: poses over time, read from CSV.
#pragma once

#include <filesystem>
#include <istream>
#include <vector>

#include "base/status.h"
#include "base/view.h"

namespace tessera {

// Header line `t_seconds,px,py,pz,qx,qy,qz,qw`, then one pose a line; times strictly increase, in seconds.
// Any value that is not finite, a time that does not increase, or a wrong column count is an error that names
// the line.
class CameraPath {
 public:
  static StatusOr<CameraPath> load(const std::filesystem::path& file);
  static StatusOr<CameraPath> parse(std::istream& in, const std::string& name);
  // At least one pose, times strictly increasing.
  explicit CameraPath(std::vector<TimedPose> poses) : poses_(std::move(poses)) {}

  // The pose at `time_ns`, interpolated; before the first and after the last pose the path stands still.
  Pose at(TimeNs time_ns) const;
  DurationNs duration_ns() const { return poses_.back().time_ns - poses_.front().time_ns; }
  const std::vector<TimedPose>& poses() const { return poses_; }

 private:
  std::vector<TimedPose> poses_;
};

}  // namespace tessera
