// An io_context that a test runs until something has happened. No sleeps: every wait is for an event, and a
// run that never gets there fails instead of hanging.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <functional>

#include <boost/asio/io_context.hpp>

#include "transport/asio/asio.h"

namespace tessera::transport::test {

class AsioTest : public ::testing::Test {
 protected:
  // Handles events until `condition` holds.
  ::testing::AssertionResult run_until(const std::function<bool()>& condition) {
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!condition()) {
      if (io.stopped()) io.restart();
      if (std::chrono::steady_clock::now() > give_up)
        return ::testing::AssertionFailure() << "it never happened";
      io.run_one_for(std::chrono::seconds(1));
    }
    return ::testing::AssertionSuccess();
  }
  asio::io_context io;
};

}  // namespace tessera::transport::test
