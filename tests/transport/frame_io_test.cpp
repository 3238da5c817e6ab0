#include "transport/frame_io.h"

#include <gtest/gtest.h>

#include <random>

#include "test_streams.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::from_hex;

struct Frame {
  FrameType type;
  Bytes payload;
  bool operator==(const Frame&) const = default;
};

struct Collector {
  std::vector<Frame> frames;
  FrameParser::Handler handler() {
    return [this](FrameType type, std::span<const uint8_t> payload) {
      frames.push_back({type, Bytes(payload.begin(), payload.end())});
      return absl::OkStatus();
    };
  }
};

TEST(FrameIo, KnownBytes) {
  Bytes out;
  ASSERT_TRUE(write_frame(FrameType::bye, from_hex("0003 616263"), out).ok());
  EXPECT_EQ(out, from_hex("00000005 09 0003616263"));
}

TEST(FrameIo, AnyChunkingGivesTheSameFrames) {
  std::mt19937 random(1);
  std::vector<Frame> frames;
  Bytes stream;
  for (int i = 0; i < 60; ++i) {
    Frame frame{static_cast<FrameType>(1 + random() % 9), Bytes(i % 5 == 0 ? 0 : random() % 300)};
    for (uint8_t& b : frame.payload) b = static_cast<uint8_t>(random());
    ASSERT_TRUE(write_frame(frame.type, frame.payload, stream).ok());
    frames.push_back(std::move(frame));
  }
  for (size_t chunk = 1; chunk < 700; ++chunk) {
    FrameParser parser;
    Collector collected;
    for (size_t at = 0; at < stream.size(); at += chunk) {
      const auto piece = std::span(stream).subspan(at, std::min(chunk, stream.size() - at));
      ASSERT_TRUE(parser.feed(piece, collected.handler()).ok());
    }
    ASSERT_TRUE(collected.frames == frames) << chunk;
    EXPECT_EQ(parser.buffered_bytes(), 0u);
  }
}

TEST(FrameIo, TheLimitIsNamedAndHoldsBeforeMemoryIsTaken) {
  FrameParser parser(100);
  Collector collected;
  const Status status = parser.feed(from_hex("ffffffff 03"), collected.handler());
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(status.message().find("4294967295"), std::string::npos) << status;
  EXPECT_NE(status.message().find("max_payload (100)"), std::string::npos) << status;
  EXPECT_EQ(parser.feed(from_hex("00000000 03"), collected.handler()), status);  // for good
  EXPECT_TRUE(collected.frames.empty());

  Bytes out;
  EXPECT_FALSE(write_frame(FrameType::meta, Bytes(101), out, 100).ok());
  EXPECT_TRUE(out.empty());
  EXPECT_TRUE(write_frame(FrameType::meta, Bytes(100), out, 100).ok());
}

TEST(FrameIo, AnnouncedLengthAloneTakesNoMemory) {
  FrameParser parser;
  Collector collected;
  ASSERT_TRUE(parser.feed(from_hex("00ffffff 03 01 02"), collected.handler()).ok());
  EXPECT_LE(parser.buffered_bytes(), 16u);
}

TEST(FrameIo, TypesThatDoNotExistAreErrors) {
  for (int type = 0; type < 256; ++type) {
    FrameParser parser;
    Collector collected;
    const Bytes bytes = {0, 0, 0, 0, static_cast<uint8_t>(type)};
    EXPECT_EQ(parser.feed(bytes, collected.handler()).ok(), type >= 1 && type <= 9) << type;
  }
}

TEST(FrameIo, AHandlersErrorEndsTheStream) {
  FrameParser parser;
  int calls = 0;
  const FrameParser::Handler refuse = [&](FrameType, std::span<const uint8_t>) {
    ++calls;
    return absl::PermissionDeniedError("no");
  };
  EXPECT_EQ(parser.feed(from_hex("00000000 03 00000000 03"), refuse).code(),
            absl::StatusCode::kPermissionDenied);
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace tessera::transport
