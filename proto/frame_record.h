// base/frame_record.h as a message, and back.
#pragma once

#include "base/frame_record.h"
#include "tessera/v1/control.pb.h"

namespace tessera {

void write(const FrameRecord& record, v1::FrameRecord& out);
FrameRecord read(const v1::FrameRecord& message);

}  // namespace tessera
