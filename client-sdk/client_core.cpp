#include "client-sdk/client_core.h"

#include <atomic>
#include <utility>

#include "client-sdk/pairing.h"
#include "client-sdk/triple_buffer.h"
#include "codec/atlas_decoder.h"
#include "geometry-compression/meta_codec.h"

namespace tessera::client {
struct ClientCore::Impl {
  explicit Impl(std::unique_ptr<codec::AtlasDecoder> atlas_decoder) : decoder(std::move(atlas_decoder)) {}

  // Makes what the receiving thread knows visible to the others.
  void publish_stats() {
    pairs_published.store(pairing.published(), std::memory_order_relaxed);
    pairs_skipped.store(pairing.skipped(), std::memory_order_relaxed);
    newest_pair.store(pairing.newest(), std::memory_order_relaxed);
  }

  std::unique_ptr<codec::AtlasDecoder> decoder;
  TripleBuffer<Pair> pairs;
  Pairing pairing{pairs};
  geometry_compression::MetaFrame meta;  // kept for its memory

  std::atomic<uint64_t> pairs_published{0}, pairs_skipped{0}, atlas_frames{0}, meta_frames{0}, orphans{0},
      decode_errors{0};
  std::atomic<FrameNumber> newest_pair{0};
  std::atomic<bool> wants_key_frame{false};
};

ClientCore::ClientCore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ClientCore::~ClientCore() = default;

StatusOr<std::unique_ptr<ClientCore>> ClientCore::create(AtlasCodec codec, uint32_t max_width,
                                                         uint32_t max_height) {
  TESSERA_ASSIGN_OR_RETURN(auto decoder, codec::AtlasDecoder::create(codec, max_width, max_height));
  return std::unique_ptr<ClientCore>(new ClientCore(std::make_unique<Impl>(std::move(decoder))));
}

StatusOr<FrameNumber> ClientCore::on_atlas(std::span<const uint8_t> access_unit) {
  auto decoded = impl_->decoder->decode(access_unit);
  // After a failure a video decoder refuses everything up to the next key frame.
  impl_->wants_key_frame.store(!decoded.ok(), std::memory_order_relaxed);
  Status status = decoded.status();
  if (decoded.ok()) {
    ++impl_->atlas_frames;
    status = impl_->pairing.on_atlas(decoded->frame, decoded->picture);
  }
  if (!status.ok()) ++(absl::IsFailedPrecondition(status) ? impl_->orphans : impl_->decode_errors);
  impl_->publish_stats();
  if (!status.ok()) return status;
  return decoded->frame;
}

StatusOr<FrameNumber> ClientCore::on_meta(std::span<const uint8_t> packet) {
  Status status;
  if (const std::string error = geometry_compression::decode(packet, impl_->meta); !error.empty()) {
    status = absl::InvalidArgumentError(absl::StrCat("meta packet of ", packet.size(), " bytes: ", error));
    impl_->pairing.on_damaged_meta();
  } else {
    ++impl_->meta_frames;
    status = impl_->pairing.on_meta(impl_->meta);
  }
  if (!status.ok()) ++impl_->decode_errors;
  impl_->publish_stats();
  if (!status.ok()) return status;
  return impl_->meta.frame;
}

bool ClientCore::wants_key_frame() const {
  return impl_->wants_key_frame.load(std::memory_order_relaxed);
}

const Pair* ClientCore::take_newest() {
  return impl_->pairs.take();
}

ClientStats ClientCore::stats() const {
  return {.pairs = impl_->pairs_published.load(std::memory_order_relaxed),
          .atlas_frames = impl_->atlas_frames.load(std::memory_order_relaxed),
          .meta_frames = impl_->meta_frames.load(std::memory_order_relaxed),
          .orphans = impl_->orphans.load(std::memory_order_relaxed),
          .decode_errors = impl_->decode_errors.load(std::memory_order_relaxed),
          .pairs_skipped = impl_->pairs_skipped.load(std::memory_order_relaxed),
          .newest_pair = impl_->newest_pair.load(std::memory_order_relaxed)};
}

}  // namespace tessera::client
