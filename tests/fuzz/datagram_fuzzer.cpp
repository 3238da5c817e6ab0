// Any datagrams to the media port: from two addresses, with two sessions.
#include <cstdlib>

#include "pieces.h"
#include "transport/session_binding.h"

using namespace tessera::transport;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  SessionBinding binding;
  SessionToken first{}, second{};
  second.fill(1);
  if (!binding.add(1, first).ok() || !binding.add(2, second).ok()) std::abort();
  uint16_t port = 0;
  for_each_piece(data, size, [&](std::span<const uint8_t> datagram) {
    const PeerAddress from{{}, static_cast<uint16_t>(port++ % 2)};
    const RoutedDatagram routed = binding.route(from, datagram);
    if (routed.answer.size() > datagram.size()) std::abort();  // no amplification
    if (routed.session && binding.address_of(*routed.session) != from) std::abort();
    if (routed.kind == DatagramKind::pose) (void)parse_pose_datagram(datagram);
  });
  return 0;
}
