#include "bench/file_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bench/temporary_folder.h"

namespace tessera::bench {
namespace {

TEST(FileIo, ReadsBackWhatWasWritten) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "a/b/c.bin";  // folders are made
  const std::vector<uint8_t> bytes{0, 255, 10, 13, 26, 0};
  ASSERT_TRUE(write_file(file, std::span(bytes)).ok());
  EXPECT_EQ(*read_file(file), bytes);
  ASSERT_TRUE(write_file(file, "shorter").ok());
  EXPECT_EQ(read_file(file)->size(), 7u);
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(file.parent_path()))
    files += entry.is_regular_file();
  EXPECT_EQ(files, 1);  // no partial file is left
}

TEST(FileIo, ErrorsNameTheFile) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_file(folder.path() / "none").status().ToString(), testing::HasSubstr("none"));
  EXPECT_FALSE(write_file(folder.path(), "a folder is no file").ok());
}

TEST(FileIo, FingerprintsAreStable) {
  EXPECT_EQ(fingerprint_hex(""), "cbf29ce484222325");  // FNV-1a, published values
  EXPECT_EQ(fingerprint_hex("a"), "af63dc4c8601ec8c");
  EXPECT_EQ(fingerprint_hex("foobar"), "85944171f73967e8");
}

}  // namespace
}  // namespace tessera::bench
