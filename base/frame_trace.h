// Frame records as files: CSV for tables, Chrome-trace JSON for chrome://tracing and Perfetto.
#pragma once

#include <ostream>
#include <span>

#include "base/frame_record.h"

namespace tessera {

// A header, then a line a frame: every timestamp (ns, each on its own end's clock), then the eight durations,
// their sum, end to end, and overhead (ms; empty where the frame was not shown).
void write_csv(std::span<const FrameRecord> records, std::ostream& out);

// A process for each session, with a track for each end and stage; all times on the server's clock, from the
// first pose on. What did not happen is left out.
void write_chrome_trace(std::span<const FrameRecord> records, std::ostream& out);

}  // namespace tessera
