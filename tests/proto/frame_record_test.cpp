#include "proto/frame_record.h"

#include <gtest/gtest.h>

#include <cstring>

namespace tessera {
namespace {

// Every field another value, so that one that is forgotten or mixed up shows.
TEST(FrameRecordMessage, ComesBackAsItWas) {
  FrameRecord record{.session = 1, .frame = 2, .key_frame = true, .atlas_bytes = 3, .meta_bytes = 4};
  record.scene_time = 5, record.pose_sent = 6, record.pose_time = 27;
  record.server = {7, 8, 9, 10, 11, 12, 13, 14, 15};
  record.client = {2, 16, 17, 18, 19, 20, 21, 22, 23, 24, -25, 26};
  v1::FrameRecord message;
  write(record, message);
  v1::FrameRecord parsed;
  ASSERT_TRUE(parsed.ParseFromString(message.SerializeAsString()));
  const FrameRecord back = read(parsed);
  EXPECT_EQ(back.session, record.session);
  EXPECT_EQ(back.frame, record.frame);
  EXPECT_EQ(back.key_frame, record.key_frame);
  EXPECT_EQ(back.atlas_bytes, record.atlas_bytes);
  EXPECT_EQ(back.meta_bytes, record.meta_bytes);
  EXPECT_EQ(back.scene_time, record.scene_time);
  EXPECT_EQ(back.pose_sent, record.pose_sent);
  EXPECT_EQ(back.pose_time, record.pose_time);
  EXPECT_EQ(back.server, record.server);
  EXPECT_EQ(back.client, record.client);
}

}  // namespace
}  // namespace tessera
