// RTCP numbers of the IANA registry; of use to the parser and the builder only.
#pragma once

#include <cstdint>

namespace tessera::transport {

constexpr uint8_t kTypeSenderReport = 200, kTypeReceiverReport = 201, kTypeDescription = 202, kTypeBye = 203,
                  kTypeTransportFeedback = 205, kTypePayloadFeedback = 206;
constexpr uint8_t kFormatNack = 1;                 // of transport feedback
constexpr uint8_t kFormatPli = 1, kFormatFir = 4;  // of payload feedback
constexpr uint8_t kSdesCname = 1;

}  // namespace tessera::transport
