// What an operator's tools read over HTTP: /healthz (the process lives), /readyz (it takes sessions),
// /metrics.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>

#include "server/http_server.h"

namespace tessera::server {

// Thread-safe.
class StatusPages {
 public:
  enum class State { starting, serving, draining };

  // From now on /metrics shows what `text` gives; before, it is 503.
  void set_metrics(std::function<std::string()> text);
  void set_state(State state) { state_ = state; }
  HttpResponse get(std::string_view path) const;

 private:
  HttpResponse ready() const;
  HttpResponse metrics() const;

  std::atomic<State> state_ = State::starting;
  mutable std::mutex mutex_;
  std::function<std::string()> metrics_;  // under the lock, which its call holds
};

}  // namespace tessera::server
