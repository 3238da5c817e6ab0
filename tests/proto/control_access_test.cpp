#include "proto/control_access.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

namespace tessera {
namespace {

using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

class ControlToken : public testing::Test {
 protected:
  ControlToken() {
    char pattern[] = "/tmp/tessera-token-XXXXXX";
    folder_ = mkdtemp(pattern);
  }
  ~ControlToken() override { fs::remove_all(folder_); }

  std::string file() const { return folder_ / "token"; }
  void write(const std::string& text, fs::perms permissions = fs::perms::owner_read) {
    fs::remove(file());
    std::ofstream(file()) << text;
    fs::permissions(file(), permissions);
  }
  std::string refusal() {
    const auto token = read_control_token(file());
    EXPECT_TRUE(absl::IsInvalidArgument(token.status())) << token.status();
    EXPECT_THAT(std::string(token.status().message()), HasSubstr(file()));
    return std::string(token.status().message());
  }

  fs::path folder_;
};

TEST_F(ControlToken, IsTheFirstLine) {
  for (const char* text : {"0123456789abcdef", "0123456789abcdef\n", "0123456789abcdef\na note\n"}) {
    write(text);
    const auto token = read_control_token(file());
    ASSERT_TRUE(token.ok()) << token.status();
    EXPECT_EQ(*token, "0123456789abcdef");
  }
  const std::string longest(1024, '~');
  write(longest + "\n");
  const auto token = read_control_token(file());
  ASSERT_TRUE(token.ok()) << token.status();
  EXPECT_EQ(*token, longest);
}

TEST_F(ControlToken, WhatIsNoTokenIsRefusedAndNotShown) {
  using std::string_literals::operator""s;
  for (const std::string& text :
       {""s, "\n"s, "secret789abcdef"s, "\nsecret6789abcdef"s, "secret 789abcdefg"s, "secret6789abcdef\r\n"s,
        "secret6789abcdef\0\n"s, "secret6789abcdef\xc3\xa4"s, std::string("secret").append(1019, 'x')}) {
    write(text);
    EXPECT_THAT(refusal(), AllOf(HasSubstr("16"), HasSubstr("openssl rand"), Not(HasSubstr("secret"))))
        << testing::PrintToString(text);
  }
}

// Group members may: systemd and Kubernetes hand secrets over in that way.
TEST_F(ControlToken, AFileThatOthersMayReadOrChangeIsRefused) {
  for (const fs::perms others : {fs::perms::others_read, fs::perms::others_write}) {
    write("secret6789abcdef", fs::perms::owner_read | others);
    EXPECT_THAT(refusal(), AllOf(HasSubstr("chmod o= "), Not(HasSubstr("secret6789"))));
  }
  write("secret6789abcdef", fs::perms::owner_read | fs::perms::group_read);
  EXPECT_TRUE(read_control_token(file()).ok());
}

TEST_F(ControlToken, AFileThatIsNotThereIsNamed) {
  EXPECT_THAT(refusal(), HasSubstr("No such file"));
  EXPECT_FALSE(read_control_token(folder_).ok());
}

}  // namespace
}  // namespace tessera
