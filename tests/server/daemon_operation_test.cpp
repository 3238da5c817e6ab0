// What an operator sees of a daemon and does to it while it runs.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "../transport/certificate.h"
#include "daemon_fixture.h"
#include "http_client.h"
#include "server/control_service.h"
#include "server/doctor.h"

namespace tessera::server {
namespace {

using grpc::StatusCode;
using testing::HasSubstr;
using testing::StartsWith;

class Operation : public DaemonTest {
 protected:
  // The value of a sample, by its whole name with labels; NaN if there is none.
  double metric(const std::string& sample) {
    std::istringstream in(test::body_of(test::get(daemon_->http_port(), "/metrics")));
    for (std::string line; std::getline(in, line);) {
      if (line.starts_with(sample + " ")) return std::stod(line.substr(sample.size() + 1));
    }
    return std::nan("");
  }
  // Of video, over the next frames, while the head turns.
  double mean_frame_bytes(client::Connection& client) {
    constexpr int kFrames = 20;
    double first = 0, bytes = 0, frames = 0;
    const TimeNs give_up = clock_.now() + kPatienceNs;
    for (int i = 0; frames < first + kFrames && clock_.now() < give_up; ++i) {
      client.send_pose({clock_.now(), {dvec3(0, 1.6, 0), glm::angleAxis(0.02 * i, dvec3(0, 1, 0))}});
      client.take_newest();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the display's rate
      frames = metric("tesserad_frames_sent_total");
      if (i == 0) first = frames, bytes = metric("tesserad_sent_bytes_total{kind=\"video\"}");
    }
    return (metric("tesserad_sent_bytes_total{kind=\"video\"}") - bytes) / (frames - first);
  }
};

TEST_F(Operation, PagesTellOfReadinessAndOfWhatRuns) {
  start({.max_sessions = 7, .scenes = {"hall=gallery:0"}});
  EXPECT_THAT(test::get(daemon_->http_port(), "/healthz"), StartsWith("HTTP/1.1 200 "));
  EXPECT_THAT(test::get(daemon_->http_port(), "/readyz"), StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(metric("tesserad_scenes"), 1);
  EXPECT_GT(metric("tesserad_scene_device_bytes"), 0);
  EXPECT_EQ(metric("tesserad_sessions"), 0);
  EXPECT_EQ(metric("tesserad_limit{option=\"max-sessions\"}"), 7);
  EXPECT_GT(metric("process_resident_memory_bytes"), 1e6);
}

// As the daemon does while its scenes load and while it drains.
TEST_F(Operation, NothingNewIsLetInBeforeAndAfterItServes) {
  auto device = gpu::Device::create({.select = "cpu"});
  ASSERT_TRUE(device.ok()) << device.status();
  auto streams = StreamServer::create({}, clock_);
  ASSERT_TRUE(streams.ok()) << streams.status();
  SceneLibrary scenes(*device, **streams, "", 0);
  ASSERT_TRUE(scenes.load_trusted("hall", "gallery:0").ok());
  ControlService control(**streams, scenes, {});
  v1::CreateSessionRequest request;
  request.set_scene("hall");
  v1::Ticket ticket;
  const auto create = [&] { return control.CreateSession(nullptr, &request, &ticket); };
  expect_refused(create(), StatusCode::UNAVAILABLE, "loading");
  control.open();
  EXPECT_TRUE(create().ok());
  control.drain();
  expect_refused(create(), StatusCode::UNAVAILABLE, "shutting down");
  v1::LoadSceneRequest load;
  v1::Scene scene;
  expect_refused(control.LoadScene(nullptr, &load, &scene), StatusCode::UNAVAILABLE, "shutting down");
}

// RELIABILITY R14, over sockets.
TEST_F(Operation, ADrainLetsNothingNewInAndKeepsWhatRuns) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket, second;
  ASSERT_TRUE(create("hall", &ticket).ok());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_THAT(test::get(daemon_->http_port(), "/readyz"), StartsWith("HTTP/1.1 200 "));
  daemon_->drain();
  expect_refused(create("hall", &second), StatusCode::UNAVAILABLE, "shutting down");
  expect_refused(load("second", "gallery:0"), StatusCode::UNAVAILABLE, "shutting down");
  EXPECT_THAT(test::get(daemon_->http_port(), "/readyz"),
              testing::AllOf(StartsWith("HTTP/1.1 503 "), HasSubstr("draining")));
  EXPECT_THAT(test::get(daemon_->http_port(), "/healthz"), StartsWith("HTTP/1.1 200 "));
  EXPECT_NE(first_pair(**client), nullptr) << (*client)->status();
  EXPECT_TRUE(get(ticket.session()).connected());
}

TEST_F(Operation, ServerInfoNamesDeviceEncoderAndLimits) {
  start({.max_sessions = 5, .max_atlas_mtexels = 6, .max_scene_mib = 700, .max_watchers = 8});
  grpc::ClientContext context;
  v1::ServerInfo info;
  ASSERT_TRUE(control_->GetServerInfo(&context, {}, &info).ok());
  EXPECT_EQ(info.version(), version());
  EXPECT_TRUE(info.software_rendering());
  EXPECT_FALSE(info.device().empty());
  EXPECT_THAT(info.encoder(), HasSubstr("264"));
  EXPECT_EQ(info.limits().max_sessions(), 5u);
  EXPECT_EQ(info.limits().max_atlas_mtexels(), 6u);
  EXPECT_EQ(info.limits().max_scene_mib(), 700u);
  EXPECT_EQ(info.limits().max_watchers(), 8u);
}

TEST_F(Operation, AnAtlasThatIsTooSmallIsTold) {
  start({.scenes = {"hall=gallery:0"}});
  const auto watched = [&](const v1::Density& density) {
    v1::Ticket ticket;
    EXPECT_TRUE(create("hall", &ticket, 64, density).ok());
    auto client = connect(ticket);
    EXPECT_TRUE(client.ok()) << client.status();
    EXPECT_NE(first_pair(**client), nullptr);
    return get(ticket.session()).atlas();
  };
  EXPECT_GT(watched({}).bias(), 0);
  v1::Density fixed;
  fixed.set_bias(-2);
  const v1::AtlasUse full = watched(fixed);
  EXPECT_EQ(full.bias(), -2);
  EXPECT_GT(full.without_place(), 0u);
}

// Totals never fall when a session ends; its own series go.
TEST_F(Operation, MetricsCountWhatASessionDoesAndKeepItAfterwards) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  v1::Density roomy;  // all have a place from the first frame on, whatever it shows
  roomy.set_bias(1);
  ASSERT_TRUE(create("hall", &ticket, 2048, roomy).ok());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  ASSERT_NE(first_pair(**client), nullptr);
  const std::string label = "{session=\"" + std::to_string(ticket.session()) + "\"}";
  EXPECT_EQ(metric("tesserad_clients_connected"), 1);
  EXPECT_EQ(metric("tesserad_session_connected" + label), 1);
  EXPECT_EQ(metric("tesserad_atlas_texels"), 2048 * 256);
  const double frames = metric("tesserad_frames_sent_total");
  EXPECT_GT(frames, 0);
  EXPECT_GE(metric("tesserad_render_stage_seconds_count{stage=\"shading\"}"), frames);
  EXPECT_GT(metric("tesserad_render_stage_seconds_sum{stage=\"encode\"}"), 0);
  EXPECT_GE(metric("tesserad_key_frames_total"), 1);
  EXPECT_GT(metric("tesserad_sent_bytes_total{kind=\"video\"}"), 1000);
  EXPECT_GT(metric("tesserad_sent_bytes_total{kind=\"geometry\"}"), 0);
  const v1::Session session = get(ticket.session());
  EXPECT_GE(session.key_frames(), 1u);
  EXPECT_GT(session.packets_sent(), 0u);
  EXPECT_THAT(session.encoder(), HasSubstr("264"));
  EXPECT_GT(session.atlas().used(), 0.025);
  EXPECT_LT(session.atlas().used() + session.atlas().fragmented(), 1);
  EXPECT_EQ(session.atlas().without_place(), 0u);
  EXPECT_GT(metric("tesserad_session_atlas_used_ratio" + label), 0.025);
  EXPECT_LT(metric("tesserad_session_atlas_fragmented_ratio" + label), 1);
  EXPECT_EQ(metric("tesserad_session_atlas_patches_without_place" + label), 0);
  EXPECT_EQ(metric("tesserad_session_atlas_bias" + label), session.atlas().bias());

  ASSERT_TRUE(remove(ticket.session()).ok());
  EXPECT_EQ(metric("tesserad_sessions"), 0);
  EXPECT_GE(metric("tesserad_frames_sent_total"), frames);
  EXPECT_TRUE(std::isnan(metric("tesserad_session_connected" + label)));
}

TEST_F(Operation, RefusalsAreCounted) {
  start({.max_sessions = 1, .scenes = {"hall=gallery:0"}});
  v1::Ticket ticket, second;
  ASSERT_TRUE(create("hall", &ticket).ok());
  expect_refused(create("hall", &second), StatusCode::RESOURCE_EXHAUSTED, "--max-sessions");
  EXPECT_EQ(metric(R"(tesserad_refusals_total{call="CreateSession",reason="RESOURCE_EXHAUSTED"})"), 1);
  ticket.mutable_token()->at(3) ^= 1;
  EXPECT_FALSE(connect(ticket).ok());
  EXPECT_EQ(metric(R"(tesserad_refusals_total{call="connect",reason="UNAUTHENTICATED"})"), 1);
}

TEST_F(Operation, LimitsNameThemselvesAndTheirOption) {
  start({.max_atlas_mtexels = 1, .max_scene_mib = 100, .max_watchers = 1, .scenes = {"hall=gallery:0"}});
  v1::Ticket first, second;
  ASSERT_TRUE(create("hall", &first, 2048).ok());  // half of it: 2048 x 256
  ASSERT_TRUE(create("hall", &second, 2048).ok());
  expect_refused(create("hall", &second, 64), StatusCode::RESOURCE_EXHAUSTED, "--max-atlas-mtexels");
  ASSERT_TRUE(remove(first.session()).ok());
  EXPECT_TRUE(create("hall", &first, 64).ok()) << "room again";

  expect_refused(load("second", "gallery:0"), StatusCode::RESOURCE_EXHAUSTED, "--max-scene-mib");
  ASSERT_TRUE(remove(first.session()).ok());
  ASSERT_TRUE(remove(second.session()).ok());
  EXPECT_TRUE(eventually([&] { return unload("hall").ok(); }));
  EXPECT_TRUE(load("second", "gallery:0").ok()) << "room again";

  ASSERT_TRUE(create("second", &first, 64).ok());
  const auto watch = [&](grpc::ClientContext& context) {
    v1::WatchSessionRequest request;
    request.set_session(first.session());
    request.set_interval_ms(10);
    return control_->WatchSession(&context, request);
  };
  grpc::ClientContext context, other;
  const auto reader = watch(context);
  v1::Session session;
  ASSERT_TRUE(reader->Read(&session));
  const auto refused = watch(other);
  EXPECT_FALSE(refused->Read(&session));
  expect_refused(refused->Finish(), StatusCode::RESOURCE_EXHAUSTED, "--max-watchers");
  context.TryCancel();
  EXPECT_TRUE(eventually([&] {
    grpc::ClientContext next;
    return watch(next)->Read(&session);
  })) << "room again";
}

TEST_F(Operation, RatesChangeWhileTheClientStays) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  auto client = connect(ticket);
  ASSERT_TRUE(client.ok()) << client.status();
  ASSERT_NE(first_pair(**client), nullptr);

  const double before = mean_frame_bytes(**client);
  v1::SessionSettings wanted;
  wanted.set_bitrate_mbps(0.1);
  wanted.set_frames_per_second(120);
  v1::Session session;
  ASSERT_TRUE(update(ticket.session(), wanted, &session).ok());
  EXPECT_EQ(session.settings().bitrate_mbps(), 0.1);
  EXPECT_EQ(session.settings().frames_per_second(), 120);
  EXPECT_EQ(session.settings().atlas_width(), 512u) << "what is not named stays";
  const double after = mean_frame_bytes(**client);
  EXPECT_LT(after, before / 2) << "a two-hundredth of the rate, four times the frames";
  EXPECT_TRUE((*client)->status().ok()) << (*client)->status();
  EXPECT_EQ(get(ticket.session()).settings().bitrate_mbps(), 0.1) << "and stays";
}

TEST_F(Operation, AnUpdateThatCannotBeIsRefusedWhole) {
  start({.scenes = {"hall=gallery:0"}});
  v1::Ticket ticket;
  ASSERT_TRUE(create("hall", &ticket).ok());
  v1::SessionSettings wanted;
  wanted.set_bitrate_mbps(3);
  wanted.set_atlas_width(1024);
  expect_refused(update(ticket.session(), wanted), StatusCode::FAILED_PRECONDITION, "create a session");
  wanted.set_atlas_width(512);
  wanted.set_frames_per_second(1e9);
  expect_refused(update(ticket.session(), wanted), StatusCode::INVALID_ARGUMENT, "frames_per_second");
  EXPECT_EQ(get(ticket.session()).settings().bitrate_mbps(), 20);
  expect_refused(update(99, wanted), StatusCode::NOT_FOUND, "99");
}

std::vector<std::string> failed(const std::vector<Finding>& findings) {
  std::vector<std::string> out;
  for (const Finding& finding : findings)
    if (!finding.status.ok()) out.push_back(finding.check);
  return out;
}

TEST_F(Operation, DoctorNamesEachFaultAndNoOther) {
  const DaemonSettings free{.control_port = 0, .meta_port = 0, .media_port = 0, .http_port = 0};
  EXPECT_THAT(failed(examine(free)), testing::IsEmpty());
  start({.scenes = {}});
  DaemonSettings s = free;
  s.control_port = daemon_->control_port();
  EXPECT_THAT(failed(examine(s)), testing::ElementsAre("control port"));
  s.meta_port = daemon_->meta_port();
  s.media_port = daemon_->media_port();
  s.http_port = daemon_->http_port();
  EXPECT_THAT(failed(examine(s)),
              testing::ElementsAre("control port", "meta port", "media port", "http port"));
  s = free;
  s.address = "0.0.0.0";
  EXPECT_THAT(failed(examine(s)), testing::ElementsAre("configuration", "control token"));
  s.insecure = true;
  EXPECT_THAT(failed(examine(s)), testing::IsEmpty());
  s = free;
  s.scenes = {"a=/no/such/file.glb", "b"};
  s.scene_root = "/no/such/folder";
  s.device = "no such device";
  EXPECT_THAT(failed(examine(s)), testing::ElementsAre("scene root", "scene", "scene", "device"));
  s = free;
  s.tls_certificate = s.tls_key = "/no/such/file.pem";
  const auto findings = examine(s);
  EXPECT_THAT(failed(findings), testing::ElementsAre("configuration"));
  EXPECT_THAT(std::string(findings[0].status.message()), HasSubstr("/no/such/file.pem"));
}

TEST_F(Operation, DoctorReadsCertificates) {
  const transport::test::Certificate good("localhost"), other("localhost"), old("localhost", -60);
  DaemonSettings s{.control_port = 0, .meta_port = 0, .media_port = 0, .http_port = 0};
  s.tls_certificate = good.certificate_file();
  EXPECT_THAT(failed(examine(s)), testing::ElementsAre("configuration")) << "no key";
  s.tls_key = other.key_file();
  EXPECT_THAT(failed(examine(s)), testing::ElementsAre("configuration")) << "another's key";
  s.tls_key = good.key_file();
  EXPECT_THAT(failed(examine(s)), testing::IsEmpty());
  s.tls_certificate = old.certificate_file();
  s.tls_key = old.key_file();
  const auto findings = examine(s);
  EXPECT_THAT(failed(findings), testing::ElementsAre("configuration"));
  EXPECT_THAT(std::string(findings[0].status.message()), HasSubstr("expired"));
}

// tesserad doctor and its exit codes.
TEST_F(Operation, DoctorIsACommand) {
  const auto run = [](const std::string& arguments, std::string& out) {
    out.clear();
    FILE* pipe = popen((std::string(TESSERAD) + " " + arguments + " 2>/dev/null").c_str(), "r");
    char buffer[4096];
    for (size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) out.append(buffer, n);
    return WEXITSTATUS(pclose(pipe));
  };
  const std::string ports = " --control-port 0 --meta-port 0 --media-port 0 --http-port 0";
  std::string out;
  EXPECT_EQ(run("doctor" + ports, out), 0);
  EXPECT_THAT(out, HasSubstr("ok      device: "));
  EXPECT_EQ(run("doctor --json --address 0.0.0.0" + ports, out), 1);
  const auto json = nlohmann::json::parse(out, nullptr, false);
  ASSERT_TRUE(json.is_object()) << out;
  EXPECT_FALSE(json["ok"]);
  EXPECT_FALSE(json["checks"][0]["ok"]);
}

}  // namespace
}  // namespace tessera::server
