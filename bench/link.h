// One direction of an emulated network, in virtual time: a bottleneck queue of limited rate, then delay,
// jitter and loss.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <random>
#include <vector>

#include "base/time.h"

namespace tessera::bench {

struct LinkSettings {
  double rate_bps = std::numeric_limits<double>::infinity();  // of the bottleneck, > 0
  DurationNs delay_ns = 0;                                    // one way, after the bottleneck
  DurationNs jitter_ns = 0;  // uniform ± around the delay (which stays >= 0), per datagram
  double loss = 0;           // share of datagrams lost after the bottleneck, [0, 1)
  uint64_t seed = 1;
};

enum class Channel : uint8_t {
  meta,   // messages are delivered in the order in which they were sent
  atlas,  // messages are delivered as they complete
};

struct Delivery {
  uint64_t id = 0;  // as send() returned it
  Channel channel = Channel::meta;
  TimeNs sent_ns = 0, delivered_ns = 0;
  std::vector<uint8_t> payload;
};

struct LinkStats {
  uint64_t messages = 0, datagrams = 0;  // datagrams: retransmissions included
  uint64_t datagrams_lost = 0, bytes_on_wire = 0;
};

// Messages are cut into datagrams of at most kDatagramBytes. A lost datagram joins the queue again one round
// trip (two delays) after it was lost, as a NACK would have it, until it arrives. Nothing is dropped for
// good; a queue may grow without limit, so the sender paces itself by queued_ns(). The same calls with the
// same seed give the same deliveries.
//
// Times passed to send() and poll() never decrease over all calls.
class Link {
 public:
  static constexpr uint32_t kDatagramBytes = 1200;

  explicit Link(const LinkSettings& settings);

  // An empty payload still travels, as one datagram without bytes.
  uint64_t send(TimeNs now, Channel channel, std::vector<uint8_t> payload);
  // When to call poll() next: at this time a message is delivered, or a datagram is sent again (then poll()
  // may return nothing). Empty when nothing is under way.
  std::optional<TimeNs> next_event_ns() const;
  // What arrived up to `now`, by time of delivery.
  std::vector<Delivery> poll(TimeNs now);

  // The backlog in front of the bottleneck; lost datagrams whose retransmission is not yet due do not count.
  DurationNs queued_ns(TimeNs now) const;  // time until it is drained
  uint64_t queued_bytes(TimeNs now) const;
  const LinkStats& stats() const { return stats_; }

 private:
  struct Message {
    Delivery delivery;
    uint32_t datagrams_missing = 0;
    TimeNs complete_ns = 0;  // arrival of its last datagram so far
  };
  struct Datagram {  // waiting to join the queue again
    TimeNs due_ns;
    uint64_t order;  // breaks ties
    uint64_t message;
    uint32_t bytes;
    bool operator>(const Datagram& o) const {
      return due_ns != o.due_ns ? due_ns > o.due_ns : order > o.order;
    }
  };

  void run_until(TimeNs now);
  void transmit(TimeNs now, uint64_t message, uint32_t bytes);
  void release_meta();
  void schedule_delivery(uint64_t message, TimeNs at_ns);
  double uniform();  // [0, 1)

  LinkSettings settings_;
  std::mt19937_64 random_;
  LinkStats stats_;
  TimeNs busy_until_ns_ = 0;
  uint64_t next_id_ = 0, next_order_ = 0;
  std::map<uint64_t, Message> in_flight_;  // by id
  std::priority_queue<Datagram, std::vector<Datagram>, std::greater<>> retransmissions_;
  std::deque<uint64_t> meta_order_;  // undelivered meta messages, oldest first
  TimeNs last_meta_ns_ = 0;
  std::multimap<TimeNs, Delivery> deliveries_;  // future ones, by time
};

}  // namespace tessera::bench
