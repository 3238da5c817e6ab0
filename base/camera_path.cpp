#include "base/camera_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"

namespace tessera {
namespace {

constexpr size_t kColumns = 8;

StatusOr<TimedPose> parse_line(const std::string& line, const std::string& where) {
  const std::vector<absl::string_view> cells = absl::StrSplit(absl::StripTrailingAsciiWhitespace(line), ',');
  if (cells.size() != kColumns) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: %d columns, expected %d (t_seconds,px,py,pz,qx,qy,qz,qw)", where, cells.size(), kColumns));
  }
  std::array<double, kColumns> v;
  for (size_t i = 0; i < kColumns; ++i) {
    if (!absl::SimpleAtod(cells[i], &v[i]) || !std::isfinite(v[i])) {
      return absl::InvalidArgumentError(
          absl::StrFormat("%s: column %d is not a finite number", where, i + 1));
    }
  }
  if (std::abs(v[0]) > 1e9)
    return absl::InvalidArgumentError(absl::StrCat(where, ": time is out of range (1e9 s)"));
  const Pose pose{dvec3(v[1], v[2], v[3]), dquat(v[7], v[4], v[5], v[6])};
  return TimedPose{from_seconds(v[0]), normalized(pose)};
}

}  // namespace

StatusOr<CameraPath> CameraPath::load(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) return absl::NotFoundError(absl::StrCat("camera path ", file.string(), ": cannot open the file"));
  return parse(in, file.string());
}

StatusOr<CameraPath> CameraPath::parse(std::istream& in, const std::string& name) {
  std::vector<TimedPose> poses;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (number == 1 || absl::StripAsciiWhitespace(line).empty()) continue;
    const std::string where = absl::StrFormat("camera path %s: line %d", name, number);
    TESSERA_ASSIGN_OR_RETURN(TimedPose pose, parse_line(line, where));
    if (!poses.empty() && pose.time_ns <= poses.back().time_ns) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": time does not increase"));
    }
    poses.push_back(pose);
  }
  if (poses.empty()) return absl::InvalidArgumentError(absl::StrCat("camera path ", name, ": holds no pose"));
  return CameraPath(std::move(poses));
}

Pose CameraPath::at(TimeNs time_ns) const {
  const auto after = std::upper_bound(poses_.begin(), poses_.end(), time_ns,
                                      [](TimeNs t, const TimedPose& p) { return t < p.time_ns; });
  if (after == poses_.begin()) return poses_.front().pose;
  if (after == poses_.end()) return poses_.back().pose;
  const TimedPose &a = after[-1], &b = *after;
  return interpolate(a.pose, b.pose,
                     static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns));
}

}  // namespace tessera
