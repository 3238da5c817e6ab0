// What an app's developer does: install the library, build against what lies there, and run.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "client-sdk/ticket.h"
#include "daemon_fixture.h"

namespace tessera::client::test {
namespace {

namespace fs = std::filesystem;

class EmbedTest : public DaemonFixture {
 protected:
  void SetUp() override {
    char pattern[] = "/tmp/tessera-embed-XXXXXX";
    folder_ = mkdtemp(pattern);
    for (const char* component : {"client-runtime", "client-development"})
      ASSERT_EQ(run(std::string("cmake --install ") + TESSERA_BUILD + " --prefix " + prefix() +
                    " --component " + component),
                0)
          << output_;
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string prefix() const { return (folder_ / "prefix").string(); }
  std::string library_folder() const { return prefix() + "/" + TESSERA_LIBRARY_FOLDER; }
  // The exit code; output_ has what it printed, both streams.
  int run(const std::string& command) {
    const fs::path log = folder_ / "log";
    const int status = std::system((command + " >" + log.string() + " 2>&1").c_str());
    std::stringstream text;
    text << std::ifstream(log).rdbuf();
    output_ = text.str();
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  fs::path folder_;
  std::string output_;
};

TEST_F(EmbedTest, TheExampleBuiltByFindPackageShowsASession) {
  start({});
  const std::string build = (folder_ / "build").string();
  ASSERT_EQ(run("cmake -G Ninja -S " TESSERA_SOURCE "/client-sdk/examples/embed -B " + build +
                " -DCMAKE_PREFIX_PATH=" + prefix() + " && cmake --build " + build),
            0)
      << output_;
  const std::string picture = (folder_ / "eyes.ppm").string();
  ASSERT_EQ(run("TESSERA_TICKET='" + to_string(new_ticket()) + "' " + build + "/embed " + picture), 0)
      << output_;
  EXPECT_NE(output_.find("first: frame "), std::string::npos) << output_;
  EXPECT_NE(output_.find("30 frames drawn"), std::string::npos) << output_;

  std::ifstream ppm(picture, std::ios::binary);
  std::stringstream text;
  text << ppm.rdbuf();
  const std::string pixels = text.str().substr(text.str().find("255\n") + 4);
  ASSERT_EQ(pixels.size(), 3u * 320 * 120);
  std::set<std::string> colors;
  for (size_t i = 0; i < pixels.size(); i += 3) colors.insert(pixels.substr(i, 3));
  EXPECT_GT(colors.size(), 1000u) << "a shaded scene, not a background";
}

TEST_F(EmbedTest, AProgramInCIsBuiltByPkgConfig) {
  const std::string program = (folder_ / "header").string();
  ASSERT_EQ(run("cc -std=c99 -pedantic -Wall -Wextra -Wno-missing-field-initializers -Werror -o " + program +
                " " TESSERA_SOURCE "/tests/client-sdk/header.c $(PKG_CONFIG_PATH=" + library_folder() +
                "/pkgconfig pkg-config --cflags --libs tessera-client)"),
            0)
      << output_;
  EXPECT_EQ(run("LD_LIBRARY_PATH=" + library_folder() + " " + program), 0) << output_;
  EXPECT_NE(output_.find("TESSERA_ERROR_VALIDATION: ticket:"), std::string::npos) << output_;
}

TEST_F(EmbedTest, TheLibraryExportsTheCInterfaceAndNothingElse) {
  ASSERT_EQ(run("nm -D --defined-only --format=posix " + library_folder() + "/libtessera-client.so"), 0)
      << output_;
  std::istringstream lines(output_);
  std::set<std::string> exported;
  for (std::string line; std::getline(lines, line);)
    exported.insert(line.substr(0, line.find_first_of("@ ")));
  EXPECT_EQ(exported.erase("TESSERA_CLIENT_0"), 1u) << "the version that the symbols have";

  std::stringstream header;
  header << std::ifstream(prefix() + "/include/tessera/tessera.h").rdbuf();
  std::set<std::string> declared;
  const std::string text = header.str(), mark = "TESSERA_API ";
  for (size_t at = text.find("\n" + mark); at != std::string::npos; at = text.find("\n" + mark, at + 1)) {
    const size_t end = text.find('(', at);
    const size_t begin = text.find_last_of(" *\n", end) + 1;
    declared.insert(text.substr(begin, end - begin));
  }
  EXPECT_GT(declared.size(), 10u);
  EXPECT_EQ(exported, declared);
}

}  // namespace
}  // namespace tessera::client::test
