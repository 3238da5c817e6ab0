// The whole daemon, steered by gRPC and watched by a real client.
#include "server/daemon.h"

#include <sys/wait.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "daemon_fixture.h"
#include "proto/frame_reader.h"
#include "transport/asio/asio.h"
#include "transport/frame_io.h"
#include "transport/messages.h"

namespace tessera::server {
namespace {

TEST_F(DaemonTest, FromLoadToPictureToUnload) {
  start();
  v1::Scene scene;
  ASSERT_TRUE(load("hall", "gallery:0", &scene).ok());
  EXPECT_GT(scene.triangles(), 0u);
  EXPECT_GT(scene.device_mib(), 0);
  EXPECT_GT(scene.plan_size(), 5);
  EXPECT_LT(scene.bounds().min_y(), 1.6);
  EXPECT_GT(scene.bounds().max_y(), 1.6) << "a hall to stand in";

  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  EXPECT_FALSE(get(ticket.session()).connected());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_NE(first_pair(**client), nullptr) << (*client)->status();
  const v1::Session session = get(ticket.session());
  EXPECT_TRUE(session.connected());
  EXPECT_GT(session.frames_sent(), 0u);
  EXPECT_EQ(session.settings().atlas_width(), 512u);
  EXPECT_EQ(session.settings().bitrate_mbps(), 20) << "the default, reported back";

  EXPECT_EQ(unload("hall").error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_TRUE(remove(ticket.session()).ok());
  const TimeNs give_up = clock_.now() + kPatienceNs;
  while ((*client)->status().ok() && clock_.now() < give_up) std::this_thread::yield();
  EXPECT_NE(std::string((*client)->status().message()).find("deleted by hand"), std::string::npos)
      << (*client)->status();
  while (!unload("hall").ok() && clock_.now() < give_up) std::this_thread::yield();
  EXPECT_EQ(unload("hall").error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(DaemonTest, ASessionHasTheCodecItWasMadeWith) {
  start({.scenes = {"hall=gallery:0"}});
  const auto create_with = [&](v1::AtlasCodec codec, uint32_t width, v1::Ticket* ticket) {
    grpc::ClientContext context;
    v1::CreateSessionRequest request;
    request.set_scene("hall");
    request.mutable_settings()->set_codec(codec);
    request.mutable_settings()->set_atlas_width(width);
    request.mutable_settings()->set_atlas_height(width / 2);
    return control_->CreateSession(&context, request, ticket);
  };
  v1::Ticket video, jpeg;
  ASSERT_TRUE(create_with(v1::ATLAS_CODEC_UNSPECIFIED, 512, &video).ok());
  EXPECT_EQ(get(video.session()).settings().codec(), v1::ATLAS_CODEC_H264) << "the default, reported back";
  ASSERT_TRUE(create_with(v1::ATLAS_CODEC_JPEG, 512, &jpeg).ok());
  EXPECT_EQ(get(jpeg.session()).settings().codec(), v1::ATLAS_CODEC_JPEG);

  auto client = connect(jpeg);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_EQ((*client)->welcome().codec, AtlasCodec::jpeg);
  EXPECT_NE(first_pair(**client), nullptr) << (*client)->status();
  EXPECT_NE(get(jpeg.session()).encoder().find("JPEG"), std::string::npos) << get(jpeg.session()).encoder();

  v1::SessionSettings wanted;
  wanted.set_codec(v1::ATLAS_CODEC_H264);
  expect_refused(update(jpeg.session(), wanted), grpc::StatusCode::FAILED_PRECONDITION, "ATLAS_CODEC_JPEG");
  wanted.set_codec(v1::ATLAS_CODEC_JPEG);
  wanted.set_bitrate_mbps(3);
  EXPECT_TRUE(update(jpeg.session(), wanted).ok());

  v1::Ticket ignored;
  expect_refused(create_with(v1::ATLAS_CODEC_RAW, 4096, &ignored), grpc::StatusCode::INVALID_ARGUMENT, "RAW");
  expect_refused(create_with(static_cast<v1::AtlasCodec>(9), 512, &ignored),
                 grpc::StatusCode::INVALID_ARGUMENT, "9");
}

TEST_F(DaemonTest, WatchersOfFramesGetEachRecordOnce) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  std::atomic<bool> enough = false;
  std::thread viewer([&] {
    while (!enough && (*client)->status().ok()) {
      const client::Pair* pair = first_pair(**client);
      if (pair) (*client)->report_displayed(pair->frame, clock_.now());
    }
  });
  const auto watch = [&](uint64_t first, bool once, size_t at_most) {
    grpc::ClientContext context;
    v1::WatchFramesRequest request;
    request.set_session(ticket.session());
    request.set_first(first);
    request.set_once(once);
    const auto reader = control_->WatchFrames(&context, request);
    std::vector<v1::FrameRecord> records;
    for (v1::FrameRecord record; records.size() < at_most && reader->Read(&record);)
      records.push_back(record);
    context.TryCancel();
    (void)reader->Finish();
    return records;
  };
  const auto records = watch(0, false, 6);
  enough = true;
  viewer.join();
  ASSERT_EQ(records.size(), 6u);
  for (size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(records[i].index(), i);
    EXPECT_EQ(records[i].session(), ticket.session());
    if (i > 0) {
      EXPECT_GT(records[i].frame(), records[i - 1].frame());
    }
  }
  const auto rest = watch(4, true, 1000);  // ends by itself
  ASSERT_GE(rest.size(), 2u);
  EXPECT_EQ(rest[0].index(), 4u);
  EXPECT_EQ(rest[0].frame(), records[4].frame());
  EXPECT_TRUE(watch(1u << 30, true, 1000).empty());
}

TEST_F(DaemonTest, AFrameReaderTellsWhyItHasNoRecords) {
  start({.max_watchers = 2, .scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  const auto read = [&](uint64_t session) { return FrameReader(*control_, session).finish().status(); };
  {
    grpc::ClientContext contexts[2];
    std::unique_ptr<grpc::ClientReader<v1::Session>> watchers[2];
    v1::WatchSessionRequest request;
    request.set_session(ticket.session());
    for (int i = 0; i < 2; ++i) {
      watchers[i] = control_->WatchSession(&contexts[i], request);
      v1::Session session;
      ASSERT_TRUE(watchers[i]->Read(&session));
    }
    const Status refused = read(ticket.session());
    EXPECT_TRUE(absl::IsResourceExhausted(refused)) << refused;
    for (int i = 0; i < 2; ++i) {
      contexts[i].TryCancel();
      (void)watchers[i]->Finish();
    }
  }
  // The server takes a moment to notice that a watcher has left.
  EXPECT_TRUE(eventually([&] { return absl::IsNotFound(read(99)); }));
  EXPECT_TRUE(eventually([&] { return read(ticket.session()).ok(); })) << "none yet is no error";
}

TEST_F(DaemonTest, WatchersSeeTheSessionUntilItEnds) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  grpc::ClientContext context;
  v1::WatchSessionRequest request;
  request.set_session(ticket.session());
  request.set_interval_ms(10);
  const auto reader = control_->WatchSession(&context, request);
  v1::Session session;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(reader->Read(&session));
    EXPECT_EQ(session.session(), ticket.session());
    EXPECT_EQ(session.scene(), "hall");
  }
  EXPECT_TRUE(remove(ticket.session()).ok());
  while (reader->Read(&session)) {
  }
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::NOT_FOUND);
}

// protobuf's texts are UTF-8: one that is not would take everybody's answer with it.
TEST_F(DaemonTest, AClientsGarbledByeLeavesSessionsReadable) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  const client::ConnectionSettings settings = connection_settings(ticket);
  const std::vector<uint8_t> hello =
      transport::encode(transport::Hello{.token = settings.token, .client = settings.client});
  std::vector<uint8_t> frames;
  ASSERT_TRUE(transport::write_frame(transport::FrameType::hello, hello, frames).ok());
  const uint8_t garbled[] = {0, 1, 0xff};
  ASSERT_TRUE(transport::write_frame(transport::FrameType::bye, garbled, frames).ok());
  namespace asio = transport::asio;
  asio::io_context io;
  asio::ip::tcp::socket socket(io);
  socket.connect({asio::ip::address_v4::loopback(), settings.meta_port});
  asio::write(socket, asio::buffer(frames));
  std::vector<uint8_t> answer(4096);
  transport::SystemError end;
  asio::read(socket, asio::buffer(answer), end);  // until the server closes

  v1::ListSessionsResponse sessions;
  EXPECT_TRUE(eventually([&] {
    grpc::ClientContext context;
    const grpc::Status status = control_->ListSessions(&context, {}, &sessions);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return !status.ok() || (sessions.sessions_size() == 1 && !sessions.sessions(0).last_client_end().empty());
  }));
  ASSERT_EQ(sessions.sessions_size(), 1);
  EXPECT_NE(sessions.sessions(0).last_client_end().find("UTF-8"), std::string::npos)
      << sessions.sessions(0).last_client_end();
}

TEST_F(DaemonTest, RefusalsNameWhatIsWrong) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  expect_refused(load("hall", "gallery:0"), grpc::StatusCode::ALREADY_EXISTS, "hall");
  expect_refused(load("a b", "gallery:0"), grpc::StatusCode::INVALID_ARGUMENT, "name");
  expect_refused(load("city", "city:x"), grpc::StatusCode::INVALID_ARGUMENT, "city:x");
  expect_refused(load("file", "/etc/passwd"), grpc::StatusCode::INVALID_ARGUMENT, "--scene-root");
  expect_refused(create("attic", &ticket), grpc::StatusCode::NOT_FOUND, "attic");
  expect_refused(create("hall", &ticket, 513), grpc::StatusCode::INVALID_ARGUMENT, "513");
  expect_refused(create("hall", &ticket, 100'000), grpc::StatusCode::INVALID_ARGUMENT, "atlas_width");
  expect_refused(remove(99), grpc::StatusCode::NOT_FOUND, "99");
}

TEST_F(DaemonTest, ADensityIsCheckedAgainstTheSceneAndKept) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  const auto with = [](const std::string& node, double density, double bias) {
    v1::Density wanted;
    wanted.set_foveation(1);
    wanted.set_bias(bias);
    v1::ObjectPriority& priority = *wanted.add_priorities();
    priority.set_node(node);
    priority.set_density(density);
    return wanted;
  };
  const auto kInvalid = grpc::StatusCode::INVALID_ARGUMENT;
  expect_refused(create("hall", &ticket, 512, with("chair", 2, 0)), kInvalid, "`chair`");
  expect_refused(create("hall", &ticket, 512, with("root", 65, 0)), kInvalid, "65");
  expect_refused(create("hall", &ticket, 512, with("root", 2, 17)), kInvalid, "settings.density.bias");
  expect_refused(create("hall", &ticket, 512, with("root", 2, NAN)), kInvalid, "settings.density.bias");
  v1::Density blind;
  blind.set_foveation(9);
  expect_refused(create("hall", &ticket, 512, blind), kInvalid, "foveation of 9");
  v1::Density many;
  for (int i = 0; i < 257; ++i) *many.add_priorities() = with("root", 2, 0).priorities(0);
  expect_refused(create("hall", &ticket, 512, many), kInvalid, "257");

  ASSERT_TRUE(create("hall", &ticket, 512, with("root", 2, 0)).ok());
  v1::SessionSettings settings = get(ticket.session()).settings();
  EXPECT_EQ(settings.density().priorities(0).node(), "root");
  settings.set_bitrate_mbps(8);
  EXPECT_TRUE(update(ticket.session(), settings).ok()) << "the same density";
  EXPECT_EQ(get(ticket.session()).settings().density().priorities_size(), 1);
  settings.mutable_density()->set_foveation(0);
  expect_refused(update(ticket.session(), settings), grpc::StatusCode::FAILED_PRECONDITION, "density");
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_NE(first_pair(**client), nullptr) << (*client)->status();
}

TEST_F(DaemonTest, FilesAreReadBelowTheSceneRootOnly) {
  const transport::test::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.file("scenes");
  std::filesystem::create_directories(folder / "inside");
  std::ofstream(folder / "outside.gltf") << "{}";
  std::ofstream(folder / "inside" / "broken.gltf") << "{}";
  std::error_code error;
  std::filesystem::create_symlink(folder / "outside.gltf", folder / "inside" / "link.gltf", error);
  start({.scene_root = (folder / "inside").string()});
  for (const char* source : {"../outside.gltf", "link.gltf", "/etc/passwd"}) {
    const grpc::Status status = load("s", source);
    EXPECT_NE(status.error_message().find("outside --scene-root"), std::string::npos)
        << source << ": " << status.error_message();
  }
  const grpc::Status broken = load("s", "broken.gltf");
  EXPECT_FALSE(broken.ok());
  EXPECT_EQ(broken.error_message().find("outside"), std::string::npos)
      << "it was read: " << broken.error_message();
}

TEST_F(DaemonTest, TheViewerProgramWritesPictures) {
  start({.scenes = {"hall=gallery:0"}});
  const transport::test::TemporaryFolder temporary;
  const std::filesystem::path folder = temporary.file("pictures");
  const auto run = [&](const std::string& arguments) {
    const std::string command = std::string(TESSERA_CLIENT) +
                                " --control 127.0.0.1:" + std::to_string(daemon_->control_port()) +
                                " --width 160 --height 90 " + arguments;
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  ASSERT_EQ(run("--scene hall --seconds 0.3 --save-every 5 --out " + folder.string() + " --json " +
                (folder / "run.json").string()),
            0);
  EXPECT_GT(std::filesystem::file_size(folder / "000000.png"), 100u);
  std::ifstream in(folder / "run.json");
  const auto json = nlohmann::json::parse(in, nullptr, false);
  EXPECT_GT(json.value("frames_displayed", 0), 0);
  EXPECT_EQ(json.value("decode_errors", -1), 0);
  EXPECT_EQ(json.value("orphans", -1), 0);
  EXPECT_EQ(run("--scene hall --codec jpeg --seconds 0.1 --json /dev/null"), 0);
  EXPECT_EQ(run("--scene hall --codec gif 2>/dev/null"), 2);
  EXPECT_EQ(run("--scene attic 2>/dev/null"), 1);
  EXPECT_EQ(run("--scene hall --fps 0 2>/dev/null"), 2);
}

TEST_F(DaemonTest, ABusyControlPortIsNamed) {
  start();
  DaemonSettings settings{
      .control_port = daemon_->control_port(), .meta_port = 0, .media_port = 0, .http_port = 0};
  const auto second = Daemon::start(settings, clock_);
  ASSERT_FALSE(second.ok());
  EXPECT_NE(std::string(second.status().message()).find(std::to_string(settings.control_port)),
            std::string::npos);
}

TEST_F(DaemonTest, ShutdownTellsClientsAndWatchers) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  ASSERT_NE(first_pair(**client), nullptr);
  grpc::ClientContext context;
  v1::WatchSessionRequest request;
  request.set_session(ticket.session());
  request.set_interval_ms(60'000);
  const auto reader = control_->WatchSession(&context, request);
  v1::Session session;
  ASSERT_TRUE(reader->Read(&session));
  daemon_.reset();
  EXPECT_FALSE(reader->Read(&session));
  const TimeNs give_up = clock_.now() + kPatienceNs;
  while ((*client)->status().ok() && clock_.now() < give_up) std::this_thread::yield();
  EXPECT_NE(std::string((*client)->status().message()).find("shutting down"), std::string::npos)
      << (*client)->status();
}

}  // namespace
}  // namespace tessera::server
