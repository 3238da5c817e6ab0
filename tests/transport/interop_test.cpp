// Independent peers: ffmpeg and GStreamer play our stream, and we receive ffmpeg's. Pictures and NAL units
// must be the very same. Skipped, with a message, where a program is missing.
#include <gmock/gmock.h>

#include <random>

#include "../codec/pictures.h"
#include "asio_fixture.h"
#include "child_process.h"
#include "codec/video_decoder.h"
#include "codec/video_encoder.h"
#include "transport/asio/endpoint.h"
#include "transport/asio/udp_socket.h"
#include "transport/datagram.h"
#include "transport/nal.h"
#include "transport/rtp_receiver.h"
#include "transport/rtp_sender.h"
#include "transport/sdp.h"
#include "transport/srtp.h"

namespace tessera::transport {
namespace {

using asio::ip::udp;
using Bytes = std::vector<uint8_t>;

constexpr uint32_t kWidth = 320, kHeight = 192;
constexpr size_t kPictureBytes = size_t{kWidth} * kHeight * 3 / 2;
constexpr int kLoop = 20;  // frames until the stream repeats, with a key frame
constexpr const char* kGstCaps =
    "application/x-rtp,media=video,clock-rate=90000,encoding-name=H264,payload=96";
constexpr DurationNs kInterval = kNsPerSecond / 60;

Bytes packed(const YuvView& p) {
  Bytes out;
  for (uint32_t y = 0; y < p.height; ++y)
    out.insert(out.end(), p.y + y * p.y_stride, p.y + y * p.y_stride + p.width);
  for (const uint8_t* plane : {p.u, p.v}) {
    for (uint32_t y = 0; y < p.height / 2; ++y)
      out.insert(out.end(), plane + y * p.uv_stride, plane + y * p.uv_stride + p.width / 2);
  }
  return out;
}

// An encoded loop and what our own decoder makes of it.
struct Clip {
  std::vector<Bytes> units, pictures;
};

const Clip& clip() {
  static const Clip made = [] {
    Clip c;
    auto encoder = *codec::VideoEncoder::create(
        {.width = kWidth, .height = kHeight, .frames_per_second = 60, .bitrate_bps = 6e6, .encoder = "x264"});
    auto decoder = *codec::VideoDecoder::create();
    for (uint32_t i = 0; i < kLoop; ++i) {
      const YuvImage image = codec::atlas_picture(kWidth, kHeight, i, 30);
      const YuvView view{kWidth, kHeight, image.y.data(), image.u.data(), image.v.data(), kWidth, kWidth / 2};
      c.units.push_back((*encoder->encode(i, view, 6e6 / 60 * (i == 0 ? 4 : 1), i == 0)).bytes);
      c.pictures.push_back(packed((*decoder->decode(c.units.back())).picture));
    }
    return c;
  }();
  return made;
}

// Two neighbouring ports that are free now.
uint16_t free_port_pair(asio::io_context& io) {
  const asio::ip::address loopback = asio::ip::make_address("127.0.0.1");
  for (;;) {
    udp::socket first(io, {loopback, 0});
    udp::socket second(io, udp::v4());
    SystemError error;
    const uint16_t port = first.local_endpoint().port();
    second.bind({loopback, static_cast<uint16_t>(port + 1)}, error);
    if (!error && port % 2 == 0) return port;
  }
}

// Sends the clip over and over, in real time, to a player that may begin to listen at any time.
class Broadcast {
 public:
  Broadcast(asio::io_context& io, uint16_t port, uint16_t rtcp_port, double loss,
            std::unique_ptr<Srtp> srtp = nullptr)
      : srtp_(std::move(srtp)), timer_(io), rtcp_(address(rtcp_port)), rtp_(address(port)), loss_(loss) {
    sender_ = *RtpSender::create({.seed = 11, .report_interval_ns = 200 * kNsPerMs});
    socket_ = *UdpSocket::open(asio::make_strand(io.get_executor()), {},
                               [this](const PeerAddress&, std::span<const uint8_t> d) {
                                 if (classify(d) == DatagramKind::rtcp)
                                   (void)sender_->on_rtcp(clock_.now(), d);
                               });
    socket_->start();
  }
  ~Broadcast() { socket_->close(); }

  RtpSender& sender() { return *sender_; }
  uint16_t port() const { return socket_->port(); }
  void start() {
    next_frame_ns_ = clock_.now();
    step();
  }

 private:
  static PeerAddress address(uint16_t port) {
    return peer_address({asio::ip::make_address("127.0.0.1"), port});
  }

  void step() {
    const TimeNs now = clock_.now();
    if (now >= next_frame_ns_) {
      const int index = frame_++ % kLoop;
      (void)sender_->send_frame(now, now, clip().units[static_cast<size_t>(index)], index == 0);
      next_frame_ns_ += kInterval;
    }
    for (Datagram& d : sender_->poll(now)) {
      const bool rtcp = classify(d) == DatagramKind::rtcp;
      const bool first_time = !rtcp && (d[1] & 0x7f) == 96;
      if (first_time && std::uniform_real_distribution<>()(random_) < loss_) continue;
      if (srtp_ && !srtp_->protect(d).ok()) ADD_FAILURE() << "SRTP";
      socket_->send(rtcp ? rtcp_ : rtp_, std::move(d));
    }
    timer_.expires_after(std::chrono::nanoseconds(
        std::max<DurationNs>(0, std::min(next_frame_ns_, sender_->next_event_ns()) - clock_.now())));
    timer_.async_wait([this](SystemError error) {
      if (!error) step();
    });
  }

  std::unique_ptr<Srtp> srtp_;
  SteadyClock clock_;
  asio::steady_timer timer_;
  PeerAddress rtcp_, rtp_;
  double loss_;
  std::mt19937 random_{5};
  std::unique_ptr<RtpSender> sender_;
  std::shared_ptr<UdpSocket> socket_;
  TimeNs next_frame_ns_ = 0;
  int frame_ = 0;
};

std::string text_of(const std::string& file) {
  const Bytes bytes = test::read_file(file);
  return {bytes.begin(), bytes.end()};
}

class Interop : public test::AsioTest {
 protected:
  // The pictures are those of the clip, in its order, from anywhere in it, without a gap.
  void expect_pictures(const std::string& file, size_t at_least) {
    const Bytes bytes = test::read_file(file);
    ASSERT_EQ(bytes.size() % kPictureBytes, 0u);
    ASSERT_GE(bytes.size() / kPictureBytes, at_least);
    size_t expected = kLoop;
    for (size_t i = 0; i < bytes.size() / kPictureBytes; ++i) {
      const auto begin = bytes.begin() + static_cast<ptrdiff_t>(i * kPictureBytes);
      const auto is = [&](const Bytes& p) { return std::equal(p.begin(), p.end(), begin); };
      if (i == 0)
        expected = static_cast<size_t>(std::ranges::find_if(clip().pictures, is) - clip().pictures.begin());
      ASSERT_LT(expected, size_t{kLoop}) << "the first picture is none of ours";
      ASSERT_TRUE(is(clip().pictures[expected])) << "picture " << i;
      expected = (expected + 1) % kLoop;
    }
  }
  test::TemporaryFolder folder;
};

TEST_F(Interop, FfmpegPlaysOurStream) {
  if (!test::have_program("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  SrtpKey key;
  for (size_t i = 0; i < key.size(); ++i) key[i] = static_cast<uint8_t>(7 * i + 1);
  for (const auto& [retransmission, encrypted] :
       {std::pair(false, false), std::pair(true, false), std::pair(false, true)}) {
    const uint16_t port = free_port_pair(io);
    Broadcast broadcast(io, port, port, 0, encrypted ? *Srtp::create(key, key) : nullptr);
    const auto sdp = make_sdp({.port = port,
                               .stream = broadcast.sender().ids(),
                               .retransmission = retransmission,
                               .srtp = encrypted ? std::optional(key) : std::nullopt},
                              clip().units[0]);
    ASSERT_TRUE(sdp.ok()) << sdp.status();
    test::write_file(folder.file("x.sdp"), *sdp);
    test::ChildProcess ffmpeg(
        absl::StrCat("ffmpeg -hide_banner -nostdin -y -protocol_whitelist file,udp,rtp,srtp -i ",
                     folder.file("x.sdp"), " -vsync passthrough -frames:v 50 -f rawvideo -pix_fmt yuv420p ",
                     folder.file("out.yuv")),
        folder.file("log"));
    broadcast.start();
    ASSERT_TRUE(run_until([&] { return ffmpeg.exit_code().has_value(); })) << text_of(folder.file("log"));
    EXPECT_EQ(ffmpeg.exit_code(), 0) << text_of(folder.file("log"));
    expect_pictures(folder.file("out.yuv"), 50);
  }
}

TEST_F(Interop, GStreamerPlaysOurStream) {
  if (!test::have_program("gst-launch-1.0")) GTEST_SKIP() << "gst-launch-1.0 is not installed";
  const uint16_t port = free_port_pair(io);
  Broadcast broadcast(io, port, static_cast<uint16_t>(port + 1), 0);
  test::ChildProcess gst(
      absl::StrCat("gst-launch-1.0 -q udpsrc address=127.0.0.1 port=", port, " caps=", kGstCaps,
                   " ! rtph264depay ! avdec_h264 ! video/x-raw,format=I420 ! identity eos-after=51",
                   " ! filesink location=", folder.file("out.yuv")),
      folder.file("log"));
  broadcast.start();
  ASSERT_TRUE(run_until([&] { return gst.exit_code().has_value(); })) << text_of(folder.file("log"));
  EXPECT_EQ(gst.exit_code(), 0) << text_of(folder.file("log"));
  expect_pictures(folder.file("out.yuv"), 50);
}

// GStreamer's session sends the NACKs, its rtprtxreceive takes our retransmissions: 3 % loss, and not one
// picture missing.
TEST_F(Interop, GStreamerRecoversLossesByOurRetransmissions) {
  if (!test::have_program("gst-launch-1.0")) GTEST_SKIP() << "gst-launch-1.0 is not installed";
  const uint16_t port = free_port_pair(io);
  Broadcast broadcast(io, port, static_cast<uint16_t>(port + 1), 0.03);
  test::ChildProcess gst(
      absl::StrCat("gst-launch-1.0 -q rtpsession name=s rtp-profile=avpf bandwidth=20000000",
                   " udpsrc address=127.0.0.1 port=", port, " caps=", kGstCaps, ",rtcp-fb-nack=(boolean)true",
                   " ! s.recv_rtp_sink s.recv_rtp_src",
                   " ! rtprtxreceive payload-type-map=application/x-rtp-pt-map,96=(uint)97",
                   " ! rtpssrcdemux name=d d. ! rtpjitterbuffer do-retransmission=true latency=1500",
                   " ! rtph264depay ! avdec_h264 ! video/x-raw,format=I420 ! identity eos-after=201",
                   " ! filesink location=", folder.file("out.yuv"),  //
                   " udpsrc address=127.0.0.1 port=", port + 1, " caps=application/x-rtcp ! s.recv_rtcp_sink",
                   " s.send_rtcp_src ! udpsink host=127.0.0.1 port=", broadcast.port(),
                   " sync=false async=false"),
      folder.file("log"));
  broadcast.start();
  ASSERT_TRUE(run_until([&] { return gst.exit_code().has_value(); })) << text_of(folder.file("log"));
  EXPECT_EQ(gst.exit_code(), 0) << text_of(folder.file("log"));
  EXPECT_GT(broadcast.sender().stats().retransmitted, 10u);
  expect_pictures(folder.file("out.yuv"), 200);
}

// ffmpeg encodes once, into a file and into RTP: the NAL units that we receive are those of the file.
TEST_F(Interop, WeReceiveFfmpegsStream) {
  if (!test::have_program("ffmpeg")) GTEST_SKIP() << "ffmpeg is not installed";
  SteadyClock clock;
  RtpReceiver receiver({});
  std::vector<ReceivedFrame> frames;
  auto socket =
      *UdpSocket::open(asio::make_strand(io.get_executor()), {}, [&](const PeerAddress&, auto datagram) {
        if (classify(datagram) == DatagramKind::rtcp) {
          EXPECT_TRUE(receiver.on_rtcp(clock.now(), datagram).ok());
        } else {
          EXPECT_TRUE(receiver.on_rtp(clock.now(), datagram).ok());
        }
        while (auto frame = receiver.take_frame()) frames.push_back(*std::move(frame));
      });
  socket->start();
  const std::string rtp =
      absl::StrCat("[f=rtp]rtp://127.0.0.1:", socket->port(), "?pkt_size=1000&rtcpport=", socket->port());
  test::ChildProcess ffmpeg(
      absl::StrCat(
          "ffmpeg -hide_banner -nostdin -y -re -f lavfi -i testsrc2=size=320x192:rate=60 -frames:v 90",
          " -c:v libx264 -preset veryfast -tune zerolatency -g 30 -b:v 4M -map 0:v", " -f tee [f=h264]",
          folder.file("sent.h264"), "|", rtp),
      folder.file("log"));
  ASSERT_TRUE(run_until([&] { return frames.size() == 90 && ffmpeg.exit_code(); }))
      << text_of(folder.file("log"));
  socket->close();

  const Bytes sent = test::read_file(folder.file("sent.h264"));
  Bytes received;
  int key_frames = 0;
  for (const ReceivedFrame& frame : frames) {
    EXPECT_TRUE(frame.complete);
    key_frames += frame.key_frame;
    received.insert(received.end(), frame.access_unit.begin(), frame.access_unit.end());
  }
  EXPECT_EQ(key_frames, 3);
  const auto nals = [](const Bytes& stream) {
    std::vector<Bytes> out;
    for (Nal nal : split_annex_b(stream)) out.emplace_back(nal.begin(), nal.end());
    return out;
  };
  EXPECT_GT(nals(sent).size(), 90u);
  EXPECT_TRUE(nals(received) == nals(sent));
}

}  // namespace
}  // namespace tessera::transport
