#include "transport/nack_generator.h"

#include <algorithm>

namespace tessera::transport {

DurationNs NackGenerator::interval_ns() const {
  return std::max(settings_.min_interval_ns, rtt_ns_ + rtt_ns_ / 4);
}

DurationNs NackGenerator::wait_ns(uint32_t tries) const {
  DurationNs wait = interval_ns();
  for (uint32_t i = kQuickTries; i < tries && wait < settings_.give_up_ns; ++i) wait += wait / 2;
  return wait;
}

void NackGenerator::on_packet(TimeNs now, ExtendedSequence sequence) {
  if (const auto found = missing_.find(sequence); found != missing_.end()) {
    learn_rtt(now, found->second);
    missing_.erase(found);
  }
  if (highest_ && sequence <= *highest_) return;
  const ExtendedSequence first = highest_ ? *highest_ + 1 : sequence;
  highest_ = sequence;
  const auto skipped = static_cast<uint64_t>(sequence - first);
  if (skipped + missing_.size() > settings_.max_missing) {
    given_up_ += skipped;
    return give_up_all();
  }
  for (ExtendedSequence s = first; s < sequence; ++s) missing_[s] = {now, now + settings_.reorder_wait_ns};
}

void NackGenerator::begin(ExtendedSequence first) {
  highest_ = first - 1;
}

// With one request the answer's delay is the round trip. With several it is not known which one was answered
// (Karn); only when nothing else has come for a while is the estimate too small, and grows until one request
// suffices.
void NackGenerator::learn_rtt(TimeNs now, const Missing& m) {
  if (m.tries == 0) return;
  const DurationNs sample = now - m.first_request_ns;
  if (m.tries == 1) {
    ambiguous_answers_ = 0;
    grown_ns_ = now;
    rtt_ns_ += (sample - rtt_ns_) / 8;
  } else if (++ambiguous_answers_ >= kAmbiguousAnswers && now - grown_ns_ >= rtt_ns_) {
    ambiguous_answers_ = 0;
    grown_ns_ = now;
    rtt_ns_ = std::max(rtt_ns_, std::min(sample, rtt_ns_ + rtt_ns_ / 2));
  }
}

TimeNs NackGenerator::due_ns(const Missing& m) const {
  return std::min(m.next_ns, m.missed_ns + settings_.give_up_ns);
}

bool NackGenerator::overdue(TimeNs now, const Missing& m) const {
  return now >= m.missed_ns + settings_.give_up_ns || (m.tries >= settings_.max_tries && now >= m.next_ns);
}

std::vector<ExtendedSequence> NackGenerator::poll(TimeNs now) {
  given_up_ += std::erase_if(missing_, [&](const auto& entry) { return overdue(now, entry.second); });
  std::vector<ExtendedSequence> out;
  for (auto& [sequence, m] : missing_) {
    if (m.next_ns > now) continue;
    if (m.tries++ == 0) m.first_request_ns = now;
    m.next_ns = now + wait_ns(m.tries);
    out.push_back(sequence);
  }
  requests_ += out.size();
  return out;
}

std::optional<TimeNs> NackGenerator::next_event_ns() const {
  std::optional<TimeNs> next;
  for (const auto& [sequence, m] : missing_) {
    if (!next || due_ns(m) < *next) next = due_ns(m);
  }
  return next;
}

std::optional<ExtendedSequence> NackGenerator::oldest_missing() const {
  if (missing_.empty()) return std::nullopt;
  return missing_.begin()->first;
}

void NackGenerator::give_up_oldest() {
  if (missing_.empty()) return;
  missing_.erase(missing_.begin());
  ++given_up_;
}

void NackGenerator::give_up_all() {
  given_up_ += missing_.size();
  missing_.clear();
}

void NackGenerator::restart() {
  give_up_all();
  highest_.reset();
}

}  // namespace tessera::transport
