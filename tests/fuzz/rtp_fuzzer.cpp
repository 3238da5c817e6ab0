// Any datagrams to a receiver, with time passing between them. Memory must stay within the settings.
#include <cstdlib>

#include "pieces.h"
#include "transport/rtp_receiver.h"

using namespace tessera;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  transport::RtpReceiver receiver({.nack = {.give_up_ns = 100 * kNsPerMs},
                                   .max_buffered_packets = 64,
                                   .max_buffered_bytes = 4096,
                                   .max_frame_bytes = 2048,
                                   .max_frames = 8});
  TimeNs now = 0;
  for_each_piece(data, size, [&](std::span<const uint8_t> datagram) {
    now += 3 * kNsPerMs;
    (void)receiver.on_rtp(now, datagram);
    for (const transport::Datagram& d : receiver.poll(now)) {
      if (d.size() > 1500) std::abort();
    }
    if (receiver.memory_bytes() > 4096 + 8 * 2048) std::abort();
    if (now % (15 * kNsPerMs) == 0) receiver.take_frame();
  });
  return 0;
}
