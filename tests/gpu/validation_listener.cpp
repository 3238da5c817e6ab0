// Linked into every test that can reach a Vulkan device: a message of the validation layer fails the test
// that runs when it comes, whichever device it is about, and also while that device is destroyed.
#include <gtest/gtest.h>
#include <spdlog/sinks/base_sink.h>

#include <memory>
#include <mutex>
#include <string_view>

#include "base/log.h"

namespace tessera::gpu {
namespace {

// gpu/ logs the layer's messages like this.
constexpr std::string_view kPrefix = "vulkan: ";

class FailingSink : public spdlog::sinks::base_sink<std::mutex> {
  void sink_it_(const spdlog::details::log_msg& message) override {
    const std::string_view text(message.payload.data(), message.payload.size());
    if (message.level >= spdlog::level::warn && text.starts_with(kPrefix)) ADD_FAILURE() << text;
  }
  void flush_() override {}
};

class ValidationListener : public testing::Environment {
  void SetUp() override { spdlog::default_logger()->sinks().push_back(std::make_shared<FailingSink>()); }
};

[[maybe_unused]] const auto* const kListener = testing::AddGlobalTestEnvironment(new ValidationListener);

}  // namespace
}  // namespace tessera::gpu
