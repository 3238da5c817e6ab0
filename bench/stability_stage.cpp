#include "bench/stability_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "bench/pairing_check.h"
#include "pvs/prediction.h"

namespace tessera::bench {
namespace {

// Holds all that the cases ask for: an atlas that is full has cases of its own.
constexpr uint32_t kAtlasSide = 512;
constexpr DurationNs kHorizonNs = 167 * kNsPerMs;  // six views: the last five look through all samples
constexpr int kSamples = 4;                        // a pixel, of truth and client
// Of blue, of which the meshes have none: one sample of background.
constexpr double kBlueASample = shading::kBackground[2] / double{kSamples};

int uncovered_samples(const uint8_t* pixel) {
  return static_cast<int>(std::lround(pixel[2] / kBlueASample));
}

}  // namespace

View stability_view(uint32_t side, const dvec3& eye) {
  View view;
  view.pose.position = eye;
  view.width = view.height = side;
  return view;
}

StatusOr<std::unique_ptr<StabilityScene>> StabilityScene::create(const StabilityContext& context,
                                                                 std::shared_ptr<const scene::Scene> scene) {
  std::unique_ptr<StabilityScene> s(new StabilityScene);
  TESSERA_ASSIGN_OR_RETURN(s->shared_, server::SharedScene::create(context.device, std::move(scene)));
  gpu::Device& device = *context.device;
  const scene::GpuScene& gpu_scene = s->shared_->gpu_scene();
  TESSERA_ASSIGN_OR_RETURN(s->instant_, scene::SceneInstant::create(device, gpu_scene));
  TESSERA_ASSIGN_OR_RETURN(s->reference_,
                           shading::ReferenceRenderer::create(device, gpu_scene, s->shared_->lighting()));
  TESSERA_ASSIGN_OR_RETURN(s->visibility_, pvs::Visibility::create(device, gpu_scene, {}));
  return s;
}

Status StabilityScene::look_from(const View& view) {
  instant_->set(0, view.pose.position);
  return shared_->lighting().update(*instant_);
}

StatusOr<shading::ReferenceImage> StabilityScene::truth(const View& view) {
  TESSERA_RETURN_IF_ERROR(look_from(view));
  return reference_->render(*instant_, view, {.samples = kSamples, .ids = true});
}

// What a session finds for a viewer who stands still: its views look through different points of their
// pixels.
StatusOr<scene::VisiblePatches> StabilityScene::visible(const View& view) {
  TESSERA_RETURN_IF_ERROR(look_from(view));
  const TimedPose pose{0, view.pose};
  const std::vector<View> views = pvs::predict_views({&pose, 1}, 0, view, {.horizon_ns = kHorizonNs});
  return visibility_->determine(*instant_, views, view);
}

StatusOr<std::unique_ptr<StabilityChain>> StabilityChain::create(StabilityScene& scene,
                                                                 const atlas::LayoutSettings& layout,
                                                                 uint32_t side) {
  std::unique_ptr<StabilityChain> chain(new StabilityChain(scene, layout));
  server::SharedScene& shared = scene.shared();
  TESSERA_ASSIGN_OR_RETURN(chain->layout_, atlas::create_layout(shared.scene(), layout));
  TESSERA_ASSIGN_OR_RETURN(chain->gather_,
                           shading::Gather::create(shared.device(), shared.gpu_scene(), shared.lighting(),
                                                   {.width = layout.width, .height = layout.height}));
  TESSERA_ASSIGN_OR_RETURN(chain->readback_,
                           gpu::Buffer::create(shared.device(), uint64_t{4} * layout.width * layout.height,
                                               gpu::Memory::readback, "stability atlas"));
  chain->meta_ = std::make_unique<server::MetaBuilder>(
      shared.scene(), server::MetaSettings{.atlas_width = static_cast<uint16_t>(layout.width),
                                           .atlas_height = static_cast<uint16_t>(layout.height)});
  TESSERA_ASSIGN_OR_RETURN(chain->display_,
                           client::Display::create({.width = side, .height = side, .samples = kSamples}));
  return chain;
}

Status StabilityChain::serve(const View& view) {
  TESSERA_ASSIGN_OR_RETURN(const scene::VisiblePatches visible, scene_.visible(view));
  const atlas::LayoutDelta delta =
      layout_->update({visible, view.pose.position, scene_.instant().instance_transforms()});
  placements_.assign(layout_->placements().begin(), layout_->placements().end());
  return shade_and_send(view, delta);
}

Status StabilityChain::serve(const View& view, std::vector<atlas::Placement> placements) {
  TESSERA_RETURN_IF_ERROR(scene_.look_from(view));
  const atlas::LayoutDelta delta = atlas::difference(placements_, placements);
  placements_ = std::move(placements);
  return shade_and_send(view, delta);
}

Status StabilityChain::shade_and_send(const View& view, const atlas::LayoutDelta& delta) {
  gpu::Device& device = scene_.shared().device();
  gpu::Commands commands = device.begin();
  TESSERA_RETURN_IF_ERROR(gather_->record(commands, scene_.instant(), view, placements_));
  commands.copy_to_buffer(gather_->image(), readback_);
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  Image8 atlas(settings_.width, settings_.height);
  std::copy_n(readback_.as<uint8_t>().begin(), atlas.rgba.size(), atlas.rgba.begin());

  const std::vector<uint8_t> packet = geometry_compression::encode(
      meta_->build(next_++, delta, {placements_, gather_->colors()}, scene_.instant().instance_transforms()));
  geometry_compression::MetaFrame received;
  if (const std::string wrong = geometry_compression::decode(packet, received); !wrong.empty())
    return absl::InternalError("meta packet: " + wrong);
  TESSERA_RETURN_IF_ERROR(checker_.check(received));
  store_.apply(received);
  TESSERA_RETURN_IF_ERROR(display_->set_atlas(atlas));
  return display_->set_state(store_.state());
}

StatusOr<Image8> StabilityChain::draw(const View& view) {
  if (!matches(store_.state(), placements_, scene_.shared().scene()))
    return absl::InternalError("the client's records differ from the server's placements");
  return display_->draw(view);
}

namespace {

bool is_interior(const shading::ReferenceImage& truth, uint32_t x, uint32_t y) {
  const uint32_t width = truth.color.width, height = truth.color.height;
  for (uint32_t j = std::max(y, 1u) - 1; j <= std::min(y + 1, height - 1); ++j)
    for (uint32_t i = std::max(x, 1u) - 1; i <= std::min(x + 1, width - 1); ++i)
      if (!truth.covered[size_t{j} * width + i]) return false;
  return true;
}

}  // namespace

PictureErrors compare_pictures(const shading::ReferenceImage& truth, const Image8& shown) {
  PictureErrors errors;
  const auto pixels = static_cast<uint32_t>(truth.covered.size());
  size_t covered = 0, holes = 0, outline = 0;
  for (uint32_t i = 0; i < pixels; ++i) {
    const uint8_t* a = &truth.color.rgba[size_t{4} * i];
    const uint8_t* b = &shown.rgba[size_t{4} * i];
    const int missing = uncovered_samples(b);
    if (!is_interior(truth, i % shown.width, i / shown.width)) {
      outline += missing != uncovered_samples(a);
      continue;
    }
    ++covered;
    holes += static_cast<size_t>(missing);
    if (missing > 0) continue;
    for (int c = 0; c < 3; ++c) errors.color = std::max(errors.color, std::abs(a[c] - b[c]) / 255.0);
  }
  const auto share = [](size_t part, size_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
  };
  errors.holes = share(holes, kSamples * covered);
  errors.outline = share(outline, pixels);
  errors.covered = share(covered, pixels);
  return errors;
}

PictureErrors worst(const PictureErrors& a, const PictureErrors& b) {
  return {std::max(a.color, b.color), std::max(a.holes, b.holes), std::max(a.outline, b.outline),
          std::min(a.covered, b.covered)};
}

void add_measures(const std::string& suffix, const PictureErrors& errors, const PictureBounds& bounds,
                  std::vector<StabilityMeasure>& measures) {
  measures.push_back({"colour, " + suffix, errors.color, bounds.color, bounds.why});
  measures.push_back({"holes, " + suffix, errors.holes, bounds.holes, bounds.holes_why});
  measures.push_back({"outline, " + suffix, errors.outline, bounds.outline,
                      "pixels at the edge of the whole, where a sample may flip"});
}

StatusOr<std::vector<StabilityMeasure>> measure_pictures(const StabilityContext& context,
                                                         std::shared_ptr<const scene::Scene> scene,
                                                         std::span<const View> views,
                                                         const PictureBounds& bounds,
                                                         std::span<const atlas::LayoutKind> layouts) {
  TESSERA_ASSIGN_OR_RETURN(const auto staged, StabilityScene::create(context, std::move(scene)));
  std::vector<shading::ReferenceImage> truths;
  for (const View& view : views) {
    TESSERA_ASSIGN_OR_RETURN(truths.emplace_back(), staged->truth(view));
  }
  std::vector<StabilityMeasure> measures;
  for (const atlas::LayoutKind kind : layouts) {
    TESSERA_ASSIGN_OR_RETURN(
        const auto chain, StabilityChain::create(
                              *staged, atlas::layout_settings(kind, kAtlasSide, kAtlasSide), views[0].width));
    PictureErrors errors{.covered = 1};
    for (size_t i = 0; i < views.size(); ++i) {
      TESSERA_RETURN_IF_ERROR(chain->serve(views[i]));
      TESSERA_ASSIGN_OR_RETURN(const Image8 shown, chain->draw(views[i]));
      errors = worst(errors, compare_pictures(truths[i], shown));
    }
    if (errors.covered == 0 && !bounds.may_show_nothing) return absl::InternalError("the case shows nothing");
    add_measures(std::string(atlas::kLayoutNames[static_cast<size_t>(kind)]), errors, bounds, measures);
  }
  return measures;
}

}  // namespace tessera::bench
