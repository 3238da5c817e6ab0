#include "include_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera::architecture {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

bool is_vulkan(const std::string& include) {
  return include.starts_with("vulkan/") || include.starts_with("vk_") || include.starts_with("volk");
}

class SourceTree : public testing::Test {
 protected:
  const std::filesystem::path root_ = TESSERA_SOURCE_DIR;
  const Rules rules_ = parse_rules(read_text(root_ / "cmake/Rooms.cmake"));
  const IncludeGraph graph_ = read_rooms(root_, rules_);
};

TEST_F(SourceTree, WasRead) {
  ASSERT_TRUE(rules_.contains("client-sdk") && rules_.contains("atlas") && rules_.contains("bench"));
  EXPECT_THAT(rules_.at("base"), IsEmpty());
  EXPECT_TRUE(rules_.at("atlas").contains("scene"));
  EXPECT_FALSE(rules_.at("atlas").contains("shading"));
  EXPECT_TRUE(rules_.at("bench").contains("server"));
  ASSERT_TRUE(graph_.contains("atlas/placement.h"));
  EXPECT_THAT(graph_.at("atlas/placement.h"),
              ElementsAre("array", "cstdint", "functional", "span", "vector", "scene/scene.h"));
}

TEST_F(SourceTree, RoomsUseOnlyTheRoomsThatTheyMay) {
  EXPECT_THAT(forbidden_uses(graph_, rules_), IsEmpty());
}

TEST_F(SourceTree, OnlyGpuIncludesVulkan) {
  for (const auto& [file, includes] : graph_) {
    if (room_of(file, rules_) == "gpu") continue;
    for (const std::string& include : includes)
      EXPECT_FALSE(is_vulkan(include)) << file << " includes " << include;
  }
}

// What runs on thin clients must not need Vulkan, not even through another header.
TEST_F(SourceTree, ClientsDoNotReachVulkan) {
  const std::set<std::string> reached =
      reachable(graph_, {"client-sdk/", "geometry-compression/", "codec/atlas_decoder.",
                         "codec/jpeg_decoder.", "codec/raw_codec.", "codec/video_decoder."});
  ASSERT_TRUE(reached.contains("codec/atlas_decoder.h") && reached.contains("codec/jpeg_tile.h"));
  for (const std::string& include : reached) {
    EXPECT_FALSE(is_vulkan(include)) << include;
    EXPECT_NE(room_of(include, rules_), "gpu") << include;
  }
}

// Its text is every shader's, the client's as well.
TEST_F(SourceTree, AddressingUsesItselfAndGlmAlone) {
  const std::string room = "atlas/addressing";
  ASSERT_TRUE(graph_.contains(room + "/block.glsl"));
  for (const std::string& include : reachable(graph_, {room})) {
    EXPECT_TRUE(room_of(include, rules_) == room || include == "glm/glm.hpp") << include;
  }
}

// It is also built to WebAssembly.
TEST_F(SourceTree, GeometryCompressionUsesTheStandardLibraryAlone) {
  const std::string room = "geometry-compression/";
  for (const std::string& include : reachable(graph_, {room})) {
    EXPECT_TRUE(include.starts_with(room) || include.find_first_of("/.") == std::string::npos) << include;
  }
}

TEST(IncludeGraph, FindsIncludesInAnyForm) {
  EXPECT_THAT(
      includes_of(
          "#include \"a/b.h\"\n  #  include <c>\n// #include <d>\nint x; #include <e>\n#include <f.h>"),
      ElementsAre("a/b.h", "c", "f.h"));
}

TEST(IncludeGraph, FindsForbiddenUses) {
  const Rules rules = parse_rules(
      "set(TESSERA_ROOMS low mid high-top)\nset(TESSERA_MAY_USE_low \"\")\nset(TESSERA_MAY_USE_mid low)\n"
      "set(TESSERA_MAY_USE_high-top mid)\n");
  const IncludeGraph graph{{"low/a.h", {"cstdint", "low/b.h"}},
                           {"low/b.h", {"mid/a.h"}},
                           {"mid/a.h", {"low/a.h", "lowest/x.h", "../high-top/a.h"}},
                           {"high-top/a.h", {"mid/a.h", "low/a.h"}}};
  EXPECT_THAT(forbidden_uses(graph, rules),
              UnorderedElementsAre("low/b.h includes mid/a.h", "mid/a.h includes ../high-top/a.h",
                                   "high-top/a.h includes low/a.h"));
  EXPECT_THAT(reachable(graph, {"high-top/"}), UnorderedElementsAre("mid/a.h", "low/a.h", "lowest/x.h",
                                                                    "../high-top/a.h", "cstdint", "low/b.h"));
}

TEST(IncludeGraph, ARoomInARoomIsItsOwn) {
  const Rules rules = parse_rules(
      "set(TESSERA_ROOMS a a/b c)\nset(TESSERA_MAY_USE_a \"\")\nset(TESSERA_MAY_USE_a/b \"\")\n"
      "set(TESSERA_MAY_USE_c a/b)\n");
  const IncludeGraph graph{{"a/x.h", {"a/b/x.h"}}, {"a/b/x.h", {"a/x.h"}}, {"c/x.h", {"a/b/y/z.h", "a/x.h"}}};
  EXPECT_THAT(
      forbidden_uses(graph, rules),
      UnorderedElementsAre("a/x.h includes a/b/x.h", "a/b/x.h includes a/x.h", "c/x.h includes a/x.h"));
}

TEST(IncludeGraph, ExpandsTheListOfAllRooms) {
  const Rules rules = parse_rules("set(TESSERA_ROOMS a b c)\nset(TESSERA_MAY_USE_c ${TESSERA_ROOMS})\n");
  EXPECT_THAT(rules.at("c"), UnorderedElementsAre("a", "b", "c"));
}

}  // namespace
}  // namespace tessera::architecture
