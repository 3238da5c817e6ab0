// The newest value from one writing thread to one reading thread, without locks or waiting: of three slots
// each side owns one, and they trade theirs for the third.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace tessera::client {

template <typename T>
class TripleBuffer {
 public:
  // Writer: the slot to fill. It holds some earlier value, whose memory can be reused.
  T& back() { return slots_[back_]; }
  // Writer: hands the back slot over. True if it replaced a value that the reader never took.
  bool publish() {
    const uint8_t previous = middle_.exchange(back_ | kFresh, std::memory_order_acq_rel);
    back_ = previous & kSlot;
    return (previous & kFresh) != 0;
  }
  // Reader: the newest value if it was not taken yet, else nullptr. Valid until the next call.
  const T* take() {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) == 0) return nullptr;
    front_ = middle_.exchange(front_, std::memory_order_acq_rel) & kSlot;
    return &slots_[front_];
  }

 private:
  static constexpr uint8_t kSlot = 3, kFresh = 4;
  std::array<T, 3> slots_;
  // Each side's index on a cache line of its own.
  alignas(64) uint8_t back_ = 0;
  alignas(64) std::atomic<uint8_t> middle_{1};
  alignas(64) uint8_t front_ = 2;
};

}  // namespace tessera::client
