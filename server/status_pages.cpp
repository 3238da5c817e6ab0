#include "server/status_pages.h"

#include <utility>

namespace tessera::server {

void StatusPages::set_metrics(std::function<std::string()> text) {
  const std::lock_guard lock(mutex_);
  metrics_ = std::move(text);
}

HttpResponse StatusPages::get(std::string_view path) const {
  if (path == "/healthz") return {.body = "ok\n"};
  if (path == "/readyz") return ready();
  if (path == "/metrics") return metrics();
  return {.status = 404, .body = "there are /metrics, /healthz and /readyz\n"};
}

HttpResponse StatusPages::ready() const {
  switch (state_.load()) {
    case State::starting:
      return {.status = 503, .body = "starting: scenes are loading\n"};
    case State::draining:
      return {.status = 503, .body = "draining: the daemon is shutting down\n"};
    case State::serving:
      break;
  }
  return {.body = "ok\n"};
}

HttpResponse StatusPages::metrics() const {
  const std::lock_guard lock(mutex_);
  if (!metrics_) return {.status = 503, .body = "starting\n"};
  return {.content_type = "text/plain; version=0.0.4; charset=utf-8", .body = metrics_()};
}

}  // namespace tessera::server
