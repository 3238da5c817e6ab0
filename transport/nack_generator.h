// Which packets are missing, when to ask for them (RFC 4585 generic NACK), and when to give them up.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "base/time.h"
#include "transport/sequence.h"

namespace tessera::transport {

struct NackSettings {
  DurationNs reorder_wait_ns = 3 * kNsPerMs;  // a packet that is merely late needs no request
  DurationNs min_interval_ns =
      10 * kNsPerMs;  // between two requests for one packet; else 5/4 of the round trip; it grows by half
                      // from each to the next after the fourth, so that a hiccup of a short way is outlasted
  uint32_t max_tries = 12;               // then the packet is given up one interval later,
  DurationNs give_up_ns = kNsPerSecond;  // or this long after it was missed, whichever comes first
  size_t max_missing = 2048;             // more at once: all are given up
  DurationNs initial_rtt_ns = 100 * kNsPerMs;
};

class NackGenerator {
 public:
  explicit NackGenerator(const NackSettings& settings)
      : settings_(settings), rtt_ns_(settings.initial_rtt_ns) {}

  // The stream begins with this packet, so that it can be missed. Else the first one that arrives is the
  // first.
  void begin(ExtendedSequence first);
  // A packet arrived, in the stream or as a retransmission. What it skips is missing from now on.
  void on_packet(TimeNs now, ExtendedSequence sequence);
  // The packets to ask for now, in ascending order. Gives up what is overdue.
  std::vector<ExtendedSequence> poll(TimeNs now);
  std::optional<TimeNs> next_event_ns() const;

  // Everything below it is there or given up. Empty: nothing is missing.
  std::optional<ExtendedSequence> oldest_missing() const;
  void give_up_oldest();
  void give_up_all();
  // Forgets the stream; the next packet begins a new one.
  void restart();

  uint64_t given_up() const { return given_up_; }  // since the start
  uint64_t requests() const { return requests_; }
  size_t missing() const { return missing_.size(); }
  // Learnt from the answers to requests; a measurement from elsewhere may be put in.
  DurationNs rtt_ns() const { return rtt_ns_; }
  void set_rtt(DurationNs rtt_ns) { rtt_ns_ = rtt_ns; }

 private:
  struct Missing {
    TimeNs missed_ns, next_ns;
    TimeNs first_request_ns = 0;
    uint32_t tries = 0;
  };
  DurationNs interval_ns() const;
  DurationNs wait_ns(uint32_t tries) const;  // after so many requests
  TimeNs due_ns(const Missing& m) const;
  bool overdue(TimeNs now, const Missing& m) const;
  void learn_rtt(TimeNs now, const Missing& m);

  NackSettings settings_;
  static constexpr int kAmbiguousAnswers = 4;
  static constexpr uint32_t kQuickTries = 4;
  DurationNs rtt_ns_;
  int ambiguous_answers_ = 0;  // in a row
  TimeNs grown_ns_ = 0;        // when the estimate was last renewed
  std::map<ExtendedSequence, Missing> missing_;
  std::optional<ExtendedSequence> highest_;
  uint64_t given_up_ = 0, requests_ = 0;
};

}  // namespace tessera::transport
