// Players that know nothing of Tessera show a session's atlas from the SDP that the daemon gives: their
// pictures are the very ones that our client decodes.
#include <gmock/gmock.h>

#include <deque>
#include <regex>
#include <set>

#include "../transport/certificate.h"
#include "daemon_fixture.h"

namespace tessera::server {
namespace {

using grpc::StatusCode;
using testing::HasSubstr;
using transport::test::ChildProcess;
using transport::test::read_file;
using Bytes = std::vector<uint8_t>;

constexpr size_t kPictureBytes = 512 * 256 * 3 / 2;
// More than lie between two key frames: a player that begins between them shows nothing right before the
// second.
constexpr int kPictures = 75, kSamePictures = 10;

// A port that is free now, on loopback. Its neighbour is too: players listen there for RTCP.
uint16_t free_udp_port() {
  boost::asio::io_context io;
  using boost::asio::ip::udp;
  const auto loopback = boost::asio::ip::make_address("127.0.0.1");
  for (;;) {
    udp::socket first(io, {loopback, 0}), second(io, udp::v4());
    const uint16_t port = first.local_endpoint().port();
    transport::SystemError error;
    second.bind({loopback, static_cast<uint16_t>(port + 1)}, error);
    if (!error && port % 2 == 0) return port;
  }
}

class Forward : public DaemonTest {
 protected:
  // A running session; its client's pictures are kept.
  void stream(const DaemonSettings& settings = {}) {
    DaemonSettings with_scene = settings;
    with_scene.scenes = {"hall=gallery:0"};
    start(with_scene);
    ASSERT_TRUE(create("hall", &ticket_).ok());
    client::ConnectionSettings connection = connection_settings(ticket_);
    if (!settings.tls_certificate.empty()) {
      auto tls = transport::TlsContext::client({settings.tls_certificate, "localhost"});
      ASSERT_TRUE(tls.ok()) << tls.status();
      connection.tls = *tls;
    }
    auto connected = client::Connection::connect(connection, clock_);
    ASSERT_TRUE(connected.ok()) << connected.status();
    client_ = *std::move(connected);
    ASSERT_NE(first_pair(*client_), nullptr) << client_->status();
  }

  // The call lives as long as `context`.
  std::unique_ptr<grpc::ClientReader<v1::Forwarding>> forward(grpc::ClientContext& context, uint32_t port) {
    v1::ForwardStreamRequest request;
    request.set_session(ticket_.session());
    request.set_port(port);
    return control_->ForwardStream(&context, request);
  }

  // Turns the head, so that each picture differs, until the player has ended.
  int watch_until_end(ChildProcess& player) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    for (int i = 0; clock_.now() < give_up; ++i) {
      if (const auto code = player.exit_code()) return *code;
      client_->send_pose({clock_.now(), {dvec3(0, 1.6, 0), glm::angleAxis(0.01 * i, dvec3(0, 1, 0))}});
      if (const client::Pair* pair = client_->take_newest()) {
        Bytes picture = pair->atlas.y;
        picture.insert(picture.end(), pair->atlas.u.begin(), pair->atlas.u.end());
        picture.insert(picture.end(), pair->atlas.v.begin(), pair->atlas.v.end());
        ours_.insert(std::move(picture));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the display's rate
    }
    return -1;
  }

  // Byte for byte. The client shows the newest pictures only, so it may lack some.
  void expect_our_pictures(const std::string& file) {
    const Bytes bytes = read_file(file);
    ASSERT_GE(bytes.size() / kPictureBytes, size_t{kPictures});
    std::set<Bytes> same;
    for (int i = 0; i < kPictures; ++i) {
      const auto begin = bytes.begin() + static_cast<ptrdiff_t>(i * kPictureBytes);
      Bytes picture(begin, begin + kPictureBytes);
      if (ours_.contains(picture)) same.insert(std::move(picture));
    }
    EXPECT_GE(same.size(), size_t{kSamePictures}) << "different ones, of " << ours_.size() << " of ours";
  }

  std::string log() {
    const Bytes bytes = read_file(folder_.file("log"));
    return {bytes.begin(), bytes.end()};
  }

  void expect_ffmpeg_plays() {
    grpc::ClientContext context;
    const auto reader = forward(context, free_udp_port());
    v1::Forwarding forwarding;
    ASSERT_TRUE(reader->Read(&forwarding)) << reader->Finish().error_message();
    transport::test::write_file(folder_.file("x.sdp"), forwarding.sdp());
    ChildProcess ffmpeg(
        absl::StrCat("ffmpeg -hide_banner -nostdin -y -protocol_whitelist file,udp,rtp,srtp -i ",
                     folder_.file("x.sdp"), " -vsync passthrough -frames:v ", kPictures,
                     " -f rawvideo -pix_fmt yuv420p ", folder_.file("out.yuv")),
        folder_.file("log"));
    EXPECT_EQ(watch_until_end(ffmpeg), 0) << log();
    expect_our_pictures(folder_.file("out.yuv"));
    ASSERT_TRUE(reader->Read(&forwarding));
    EXPECT_GT(forwarding.packets(), 0u);
    EXPECT_THAT(forwarding.sdp(), testing::IsEmpty()) << "only once";
    context.TryCancel();
  }

  v1::Ticket ticket_;
  std::unique_ptr<client::Connection> client_;
  std::set<Bytes> ours_;
  transport::test::TemporaryFolder folder_;
};

TEST_F(Forward, FfmpegPlaysTheDaemonsStream) {
  if (!transport::test::have_program("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  stream();
  expect_ffmpeg_plays();
}

TEST_F(Forward, FfmpegPlaysTheEncryptedStreamWithItsOwnKey) {
  if (!transport::test::have_program("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  const transport::test::Certificate certificate("localhost");
  stream({.tls_certificate = certificate.certificate_file(), .tls_key = certificate.key_file()});
  expect_ffmpeg_plays();
  const Bytes sdp = read_file(folder_.file("x.sdp"));
  EXPECT_THAT(std::string(sdp.begin(), sdp.end()), HasSubstr("RTP/SAVP"));
}

// What GStreamer's caps need is in the SDP: port, payload type and parameter sets.
TEST_F(Forward, GStreamerPlaysTheDaemonsStream) {
  if (!transport::test::have_program("gst-launch-1.0")) GTEST_SKIP() << "gst-launch-1.0 is not installed";
  stream();
  grpc::ClientContext context;
  const auto reader = forward(context, free_udp_port());
  v1::Forwarding forwarding;
  ASSERT_TRUE(reader->Read(&forwarding)) << reader->Finish().error_message();
  std::smatch media, sets;
  ASSERT_TRUE(std::regex_search(forwarding.sdp(), media, std::regex("m=video (\\d+) RTP/AVP (\\d+)")));
  ASSERT_TRUE(std::regex_search(forwarding.sdp(), sets, std::regex("sprop-parameter-sets=([^;\r]+)")));
  ChildProcess gst(
      absl::StrCat(
          "gst-launch-1.0 -q udpsrc address=127.0.0.1 port=", media[1].str(),
          " caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=", media[2].str(),
          ",sprop-parameter-sets=(string)\"", sets[1].str(), "\"",
          " ! rtph264depay ! avdec_h264 ! video/x-raw,format=I420 ! identity eos-after=", kPictures + 1,
          " ! filesink location=", folder_.file("out.yuv")),
      folder_.file("log"));
  EXPECT_EQ(watch_until_end(gst), 0) << log();
  expect_our_pictures(folder_.file("out.yuv"));
  context.TryCancel();
}

TEST_F(Forward, RefusalsSayWhatToDo) {
  start({.scenes = {"hall=gallery:0"}});
  const auto refused = [&](uint32_t port) {
    grpc::ClientContext context;
    const auto reader = forward(context, port);
    v1::Forwarding ignored;
    EXPECT_FALSE(reader->Read(&ignored));
    return reader->Finish();
  };
  expect_refused(refused(40000), StatusCode::NOT_FOUND, "0");
  ASSERT_TRUE(create("hall", &ticket_).ok());
  expect_refused(refused(40000), StatusCode::FAILED_PRECONDITION, "connect its client first");
  expect_refused(refused(80), StatusCode::INVALID_ARGUMENT, "1024");
  expect_refused(refused(65536), StatusCode::INVALID_ARGUMENT, "65536");
}

// A receiver that goes away takes its stream with it; so does a session that ends.
TEST_F(Forward, ItEndsWithItsCallAndWithItsSession) {
  stream();
  v1::Forwarding forwarding;
  std::deque<grpc::ClientContext> calls(transport::MediaPort::kMaxTaps);
  std::vector<std::unique_ptr<grpc::ClientReader<v1::Forwarding>>> readers;
  for (grpc::ClientContext& call : calls) {
    readers.push_back(forward(call, free_udp_port()));
    ASSERT_TRUE(readers.back()->Read(&forwarding)) << readers.back()->Finish().error_message();
  }
  grpc::ClientContext too_many;
  const auto refused = forward(too_many, free_udp_port());
  EXPECT_FALSE(refused->Read(&forwarding));
  expect_refused(refused->Finish(), StatusCode::RESOURCE_EXHAUSTED, "end one");

  calls.front().TryCancel();
  EXPECT_TRUE(eventually([&] {
    grpc::ClientContext next;
    return forward(next, free_udp_port())->Read(&forwarding);
  })) << "room again";
  ASSERT_TRUE(remove(ticket_.session()).ok());
  while (readers.back()->Read(&forwarding)) {
  }
  expect_refused(readers.back()->Finish(), StatusCode::NOT_FOUND, "ended");
}

}  // namespace
}  // namespace tessera::server
