#include "client-sdk/tools/picture_writer.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <fcntl.h>
#include <spawn.h>
#include <stb_image_write.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

extern char** environ;

namespace tessera::client {
namespace {

class PngFolder final : public PictureWriter {
 public:
  PngFolder(std::string folder, uint32_t save_every) : folder_(std::move(folder)), save_every_(save_every) {}

  StatusOr<std::string> write(const Image8& picture, uint64_t index) override {
    if (index % save_every_ != 0) return "";
    if (waiting_bytes_ + picture.rgba.size() > kMaxWaitingBytes) TESSERA_RETURN_IF_ERROR(finish());
    std::string file = absl::StrFormat("%s/%06d.png", folder_, index);
    waiting_.emplace_back(file, picture);
    waiting_bytes_ += picture.rgba.size();
    return file;
  }
  Status finish() override {
    for (const auto& [file, picture] : std::exchange(waiting_, {})) {
      if (!stbi_write_png(file.c_str(), static_cast<int>(picture.width), static_cast<int>(picture.height), 4,
                          picture.rgba.data(), static_cast<int>(4 * picture.width)))
        return absl::UnavailableError(absl::StrCat("cannot write ", file));
      ++written_;
    }
    waiting_bytes_ = 0;
    return absl::OkStatus();
  }
  uint64_t written() const override { return written_; }

 private:
  static constexpr size_t kMaxWaitingBytes = 256u << 20;
  std::string folder_;
  uint32_t save_every_;
  std::vector<std::pair<std::string, Image8>> waiting_;
  size_t waiting_bytes_ = 0;
  uint64_t written_ = 0;
};

// A running ffmpeg that takes raw pictures on its standard input.
class Mp4File final : public PictureWriter {
 public:
  Mp4File(std::string file, double fps) : file_(std::move(file)), fps_(fps) {}
  ~Mp4File() override { (void)finish(); }

  StatusOr<std::string> write(const Image8& picture, uint64_t) override {
    if (pid_ < 0) TESSERA_RETURN_IF_ERROR(start(picture.width, picture.height));
    const uint8_t* next = picture.rgba.data();
    for (size_t left = picture.rgba.size(); left > 0;) {
      const ssize_t n = ::write(pipe_, next, left);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return failed("ffmpeg stopped taking pictures");
      next += n;
      left -= static_cast<size_t>(n);
    }
    ++written_;
    return file_;
  }

  Status finish() override {
    if (pid_ < 0) return absl::OkStatus();
    ::close(pipe_);
    int status = 0;
    waitpid(pid_, &status, 0);
    pid_ = -1;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? absl::OkStatus() : failed("ffmpeg failed");
  }
  uint64_t written() const override { return written_; }

 private:
  Status failed(const std::string& what) const {
    return absl::UnavailableError(absl::StrCat(what, " for ", file_, "; its own words are above"));
  }

  Status start(uint32_t width, uint32_t height) {
    if (width % 2 != 0 || height % 2 != 0)
      return absl::InvalidArgumentError(absl::StrCat("video has even sides, but pictures are ", width, "x",
                                                     height, ": change --width or --height"));
    std::vector<std::string> words{"ffmpeg",       "-loglevel",
                                   "error",        "-y",
                                   "-f",           "rawvideo",
                                   "-pix_fmt",     "rgba",
                                   "-video_size",  absl::StrCat(width, "x", height),
                                   "-framerate",   absl::StrCat(fps_),
                                   "-i",           "-",
                                   "-c:v",         "libx264",
                                   "-crf",         "18",
                                   "-pix_fmt",     "yuv420p",
                                   "-movflags",    "+faststart",
                                   "file:" + file_};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    std::array<int, 2> ends{};
    if (pipe2(ends.data(), O_CLOEXEC) != 0)
      return absl::UnavailableError(absl::StrCat("pipe: ", std::strerror(errno)));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    const int error = posix_spawnp(&pid_, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[0]);
    pipe_ = ends[1];
    if (error == 0) return absl::OkStatus();
    ::close(pipe_);
    pid_ = -1;
    return absl::UnavailableError(
        absl::StrCat("cannot start ffmpeg for ", file_, ": ", std::strerror(error),
                     "; install the package ffmpeg, or give --out a folder for PNGs"));
  }

  std::string file_;
  double fps_;
  pid_t pid_ = -1;
  int pipe_ = -1;
  uint64_t written_ = 0;
};

}  // namespace

StatusOr<std::unique_ptr<PictureWriter>> make_picture_writer(const PictureSettings& settings) {
  if (settings.out.ends_with(".mp4")) return std::make_unique<Mp4File>(settings.out, settings.fps);
  std::error_code error;
  std::filesystem::create_directories(settings.out, error);
  if (error) return absl::UnavailableError(absl::StrCat("cannot make ", settings.out, ": ", error.message()));
  return std::make_unique<PngFolder>(settings.out, settings.save_every);
}

}  // namespace tessera::client
