// The stability catalogue within its bounds, case by case (bench/stability.h; `tessera-bench stability`
// prints the same).
#include "bench/stability.h"

#include <gtest/gtest.h>

namespace tessera::bench {
namespace {

// One device for all cases; the validation layers' messages fail the test (gpu/validation_listener.cpp).
const StabilityContext& context() {
  static const StabilityContext context = [] {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    EXPECT_TRUE(device.ok()) << device.status();
    return StabilityContext{.device = device.ok() ? *std::move(device) : nullptr,
                            .sub_pixel_triangles = 20'000};
  }();
  return context;
}

}  // namespace

void PrintTo(const StabilityCase& of, std::ostream* out) {
  *out << of.input;
}

namespace {

class Stability : public testing::TestWithParam<StabilityCase> {};

TEST_P(Stability, StaysWithinItsBounds) {
  ASSERT_NE(context().device, nullptr);
  const auto measures = GetParam().run(context());
  ASSERT_TRUE(measures.ok()) << measures.status();
  EXPECT_FALSE(measures->empty());
  for (const StabilityMeasure& m : *measures) {
    EXPECT_TRUE(m.passed()) << m.what << ": " << m.error << ", bound " << m.bound << " (" << m.why << ")";
  }
}

std::string name_of(const testing::TestParamInfo<StabilityCase>& info) {
  std::string name = info.param.group + "_" + info.param.name;
  std::ranges::replace(name, '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Stability, testing::ValuesIn(stability_cases()), name_of);

}  // namespace
}  // namespace tessera::bench
