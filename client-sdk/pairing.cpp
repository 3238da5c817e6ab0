#include "client-sdk/pairing.h"

#include <algorithm>
#include <utility>

namespace tessera::client {
namespace {

void copy_plane(const uint8_t* source, uint32_t stride, uint32_t width, uint32_t height,
                std::vector<uint8_t>& out) {
  out.resize(size_t{width} * height);
  for (uint32_t row = 0; row < height; ++row) {
    std::copy_n(source + size_t{row} * stride, width, out.data() + size_t{row} * width);
  }
}

void copy_picture(const YuvView& source, YuvImage& out) {
  out.width = source.width;
  out.height = source.height;
  copy_plane(source.y, source.y_stride, source.width, source.height, out.y);
  copy_plane(source.u, source.uv_stride, source.width / 2, source.height / 2, out.u);
  copy_plane(source.v, source.uv_stride, source.width / 2, source.height / 2, out.v);
}

// Moves an element out of a pool, or makes a new one while the pool warms up.
template <typename T>
T take_spare(std::vector<T>& pool) {
  if (pool.empty()) return T{};
  T spare = std::move(pool.back());
  pool.pop_back();
  return spare;
}

}  // namespace

Status Pairing::on_atlas(FrameNumber frame, const YuvView& picture) {
  // The scene may have moved past this frame.
  const bool too_late = store_.state().epoch != 0 && !is_newer(frame, store_.state().frame);
  if (!too_late) keep(frame, picture);
  return advance();
}

Status Pairing::on_meta(const geometry_compression::MetaFrame& meta) {
  TESSERA_RETURN_IF_ERROR(checker_.check(meta));
  held_.push_back(take_spare(spare_metas_));
  held_.back() = meta;
  return advance();
}

void Pairing::keep(FrameNumber frame, const YuvView& picture) {
  auto at = std::find_if(waiting_.begin(), waiting_.end(),
                         [&](const WaitingAtlas& w) { return !is_newer(frame, w.frame); });
  if (at == waiting_.end() || at->frame != frame) {
    at = waiting_.insert(at, WaitingAtlas{frame, take_spare(spare_pictures_)});
  }
  copy_picture(picture, at->picture);
  if (waiting_.size() > kMaxWaitingAtlases) drop_where_closest();
}

void Pairing::drop(size_t index) {
  spare_pictures_.push_back(std::move(waiting_[index].picture));
  waiting_.erase(waiting_.begin() + static_cast<ptrdiff_t>(index));
}

void Pairing::drop_where_closest() {
  const auto gap_without = [&](size_t i) { return waiting_[i + 1].frame - waiting_[i - 1].frame; };
  size_t closest = 1;
  for (size_t i = 2; i + 1 < waiting_.size(); ++i) {
    if (gap_without(i) < gap_without(closest)) closest = i;
  }
  drop(closest);
}

Status Pairing::advance() {
  Status status;
  while (!held_.empty()) {
    const FrameNumber frame = held_.front().frame;
    while (!waiting_.empty() && is_newer(frame, waiting_.front().frame)) drop(0);
    // Pictures arrive in order, so a newer one means that this frame's is lost.
    const bool may_still_come = waiting_.empty() && held_.size() <= kMaxHeldMetas;
    if (may_still_come) break;
    store_.apply(held_.front());
    std::rotate(held_.begin(), held_.begin() + 1, held_.end());
    spare_metas_.push_back(std::move(held_.back()));
    held_.pop_back();
    if (!waiting_.empty() && waiting_.front().frame == frame) status.Update(complete_front());
  }
  return status;
}

Status Pairing::complete_front() {
  const FrameNumber frame = waiting_.front().frame;
  YuvImage& picture = waiting_.front().picture;
  Status status;
  if (picture.width != store_.state().atlas_width || picture.height != store_.state().atlas_height) {
    status = absl::InvalidArgumentError(absl::StrCat(
        "atlas of frame ", frame, " is ", picture.width, "x", picture.height, ", but its meta frame says ",
        store_.state().atlas_width, "x", store_.state().atlas_height));
  } else {
    Pair& pair = pairs_.back();
    pair.frame = frame;
    std::swap(pair.atlas, picture);
    store_.copy_to(pair.state);
    skipped_ += pairs_.publish() ? 1 : 0;
    ++published_;
    newest_ = frame;
  }
  drop(0);
  return status;
}

}  // namespace tessera::client
