#include "fake_renderer.h"

#include <algorithm>
#include <random>
#include <thread>
#include <utility>

namespace tessera::server::test {
namespace {

namespace gc = geometry_compression;

// One bit of the number a macroblock, so that no quantiser blurs it.
constexpr uint32_t kSquare = 16, kSquaresARow = 16, kBits = 32;
constexpr uint8_t kDark = 48, kBright = 208;

size_t corner(const YuvImage& image, uint32_t bit) {
  return size_t{bit / kSquaresARow * kSquare} * image.width + bit % kSquaresARow * kSquare;
}

void mark(YuvImage& image, FrameNumber number) {
  for (uint32_t bit = 0; bit < kBits; ++bit) {
    uint8_t* row = image.y.data() + corner(image, bit);
    for (uint32_t i = 0; i < kSquare; ++i, row += image.width)
      std::fill_n(row, kSquare, number >> bit & 1 ? kBright : kDark);
  }
}

// Noise below the number, another one in every frame: a frame is many datagrams.
YuvImage picture(uint32_t width, uint32_t height, FrameNumber number) {
  YuvImage image{width, height, std::vector<uint8_t>(size_t{width} * height),
                 std::vector<uint8_t>(size_t{width} * height / 4, 128),
                 std::vector<uint8_t>(size_t{width} * height / 4, 128)};
  std::minstd_rand random(number + 1);
  for (uint8_t& y : image.y) y = static_cast<uint8_t>(96 + (random() >> 8) % 64);
  mark(image, number);
  return image;
}

// Where the only patch lies: it moves with every frame.
uint16_t block_x(FrameNumber number) {
  return static_cast<uint16_t>(number % 64 * 2);
}

gc::MetaFrame scene(const FakeRendererSettings& s, uint32_t width, uint32_t height, FrameNumber number,
                    bool first) {
  gc::MetaFrame meta{.frame = number,
                     .atlas_width = static_cast<uint16_t>(width),
                     .atlas_height = static_cast<uint16_t>(height),
                     .full_state = first};
  if (first) {
    meta.meshes = {{}};
    meta.vertices = {{0, {0, 0, 0}}, {0, {1, 0, 0}}, {0, {0, 1, 0}}, {0, {1, 1, 0}}};
    meta.objects.resize(s.moving_objects);
    meta.patches = {{.triangles = 2, .vertices = {0, 1, 2, 3}}};
  }
  std::minstd_rand random(number + 1);
  for (uint32_t object = 0; object < s.moving_objects; ++object) {
    gc::Transform transform{.translation = {static_cast<double>(number), 0, 0}};
    for (float& value : transform.linear) value = static_cast<float>(random()) * 0x1p-30f;
    meta.moved.push_back({object, transform});
  }
  meta.placements = {{.kind = gc::PlacementKind::block, .x = block_x(number), .width = 2, .height = 2}};
  return meta;
}

class FakeRenderer final : public FrameRenderer {
 public:
  FakeRenderer(const FakeRendererSettings& fake, const SessionSettings& settings,
               std::unique_ptr<codec::AtlasEncoder> encoder)
      : fake_(fake), settings_(settings), encoder_(std::move(encoder)) {}

  void set_rate(const RateSplit& rate) override { settings_.rate = rate; }
  const std::string& encoder() const override { return encoder_->choice(); }

  StatusOr<Frame> render(const FrameInput& input) override {
    std::this_thread::sleep_for(std::chrono::nanoseconds(fake_.render_time_ns));  // the device's work
    const uint32_t width = settings_.layout.width, height = settings_.layout.height;
    Frame frame{.number = input.number, .pose = input.poses.back()};
    frame.meta = gc::encode(scene(fake_, width, height, input.number, first_), &frame.stats.meta_bits);
    const YuvImage image = picture(width, height, input.number);
    const YuvView view{width, height, image.y.data(), image.u.data(), image.v.data(), width, width / 2};
    const bool key_frame = input.key_frame || first_;
    first_ = false;
    const double budget = settings_.rate.atlas_bits(8.0 * static_cast<double>(frame.meta.size()), key_frame);
    TESSERA_ASSIGN_OR_RETURN(frame.atlas, encoder_->encode(input.number, view, budget, key_frame));
    return frame;
  }

 private:
  const FakeRendererSettings fake_;
  SessionSettings settings_;
  std::unique_ptr<codec::AtlasEncoder> encoder_;
  bool first_ = true;
};

}  // namespace

RendererFactory fake_renders(const FakeRendererSettings& fake) {
  return [fake](const SessionSettings& settings) -> StatusOr<std::unique_ptr<FrameRenderer>> {
    TESSERA_ASSIGN_OR_RETURN(
        auto encoder,
        codec::AtlasEncoder::create(settings.codec, {.width = settings.layout.width,
                                                     .height = settings.layout.height,
                                                     .frames_per_second = settings.rate.frames_per_second,
                                                     .bitrate_bps = settings.rate.bitrate_bps,
                                                     .encoder = "x264",
                                                     .preset = "ultrafast"}));
    return std::make_unique<FakeRenderer>(fake, settings, std::move(encoder));
  };
}

SessionSettings small_session() {
  SessionSettings s;
  s.layout = atlas::layout_settings(atlas::LayoutKind::blocks, 256, 128);
  s.rate.bitrate_bps = 4e6;
  return s;
}

std::optional<FrameNumber> frame_in(const YuvImage& atlas) {
  if (atlas.width < kSquaresARow * kSquare || atlas.height < kBits / kSquaresARow * kSquare)
    return std::nullopt;
  FrameNumber number = 0;
  for (uint32_t bit = 0; bit < kBits; ++bit) {
    const size_t center = corner(atlas, bit) + size_t{kSquare / 2} * atlas.width + kSquare / 2;
    if (atlas.y[center] > (kDark + kBright) / 2) number |= FrameNumber{1} << bit;
  }
  return number;
}

std::optional<FrameNumber> frame_in(const client::SceneState& state) {
  if (state.objects.empty()) return std::nullopt;
  const auto number = static_cast<FrameNumber>(state.objects.front().transform.translation[0]);
  for (const client::ObjectState& object : state.objects)
    if (object.transform.translation[0] != number) return std::nullopt;
  size_t records = 0;
  for (const auto& group : state.records) {
    for (const client::TriangleRecord& record : group) {
      ++records;
      if (client::unpack(record).x != block_x(number)) return std::nullopt;
    }
  }
  if (records != 2) return std::nullopt;
  return number;
}

}  // namespace tessera::server::test
