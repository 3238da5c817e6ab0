// Any byte stream as TCP frames, whole and in pieces, and any payload as every message.
#include <cstdlib>
#include <vector>

#include "pieces.h"
#include "transport/clock_offset.h"
#include "transport/frame_io.h"
#include "transport/messages.h"

using namespace tessera;
using namespace tessera::transport;

namespace {

void decode_all(std::span<const uint8_t> payload) {
  if (const auto m = decode_hello(payload); m.ok() && decode_hello(encode(*m))->token != m->token)
    std::abort();
  if (const auto m = decode_welcome(payload); m.ok() && decode_welcome(encode(*m))->stream != m->stream)
    std::abort();
  if (const auto m = decode_timings(payload); m.ok() && *decode_timings(encode(*m)) != *m) std::abort();
  if (const auto m = decode_pose(payload); m.ok() && !decode_pose(encode(*m)).ok()) std::abort();
  (void)decode_ping(payload);
  if (const auto m = decode_pong(payload); m.ok()) ClockOffset().on_pong(kNsPerSecond, *m);
  (void)decode_error(payload);
  (void)decode_bye(payload);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t kLimit = 512;
  std::vector<uint8_t> whole, pieces;
  const auto record = [](std::vector<uint8_t>& out) {
    return [&out](FrameType type, std::span<const uint8_t> payload) {
      if (payload.size() > kLimit) std::abort();
      decode_all(payload);
      return write_frame(type, payload, out);
    };
  };
  // The pieces as one stream, and one by one: the same frames.
  std::vector<uint8_t> stream;
  FrameParser by_pieces(kLimit), at_once(kLimit);
  for_each_piece(data, size, [&](std::span<const uint8_t> piece) {
    stream.insert(stream.end(), piece.begin(), piece.end());
    (void)by_pieces.feed(piece, record(pieces));
    if (by_pieces.buffered_bytes() > kLimit + kFrameHeaderBytes) std::abort();
  });
  (void)at_once.feed(stream, record(whole));
  if (whole != pieces) std::abort();
  decode_all({data, size});
  return 0;
}
