// tessera-client: a viewer without a window. Follows a path, draws the newest pair at the newest pose, writes
// pictures.
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <grpcpp/grpcpp.h>
#include <stb_image_write.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/camera_path.h"
#include "base/log.h"
#include "client-sdk/connection.h"
#include "client-sdk/display.h"
#include "codec/yuv.h"
#include "tessera/v1/control.grpc.pb.h"

namespace {

using namespace tessera;

enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2 };

constexpr char kFooter[] = R"(Examples:
  tessera-client --scene hall --seconds 5 --out pictures
  tessera-client --control 127.0.0.1:7310 --scene sponza --path sponza_1.csv --width 1280 --height 720 --save-every 10 --json run.json

Exit codes: 0 done, 1 the stream failed, 2 wrong usage.)";

struct Settings {
  std::string control = "127.0.0.1:7310", scene, path, out, json;
  std::vector<double> position{0, 1.6, 0};
  double seconds = 5, fps = 60, fov_y_deg = 60;
  uint32_t width = 960, height = 540, save_every = 30;
};

struct Totals {
  uint64_t displayed = 0, fresh = 0, pictures = 0;
};

Status to_status(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

// A session of its own, ended with the program.
class ControlledSession {
 public:
  static StatusOr<std::unique_ptr<ControlledSession>> create(const Settings& s) {
    std::unique_ptr<ControlledSession> session(new ControlledSession);
    session->stub_ = v1::Control::NewStub(grpc::CreateChannel(s.control, grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    v1::CreateSessionRequest request;
    request.set_scene(s.scene);
    const Status created = to_status(session->stub_->CreateSession(&context, request, &session->ticket_));
    if (created.ok()) return session;
    return absl::Status(created.code(), absl::StrCat("control at ", s.control, ": ", created.message()));
  }
  ~ControlledSession() {
    if (ticket_.session() == 0) return;
    grpc::ClientContext context;
    v1::DeleteSessionRequest request;
    request.set_session(ticket_.session());
    v1::DeleteSessionResponse response;
    stub_->DeleteSession(&context, request, &response);
  }
  const v1::Ticket& ticket() const { return ticket_; }

 private:
  ControlledSession() = default;
  std::unique_ptr<v1::Control::Stub> stub_;
  v1::Ticket ticket_;
};

View view_of(const Settings& s) {
  View view;
  view.width = s.width;
  view.height = s.height;
  view.fov = Fov::symmetric(static_cast<float>(s.fov_y_deg * 3.14159265358979 / 180),
                            static_cast<float>(s.width) / static_cast<float>(s.height));
  return view;
}

StatusOr<std::unique_ptr<client::Connection>> connect(const Settings& s, const v1::Ticket& ticket,
                                                      const Clock& clock) {
  client::ConnectionSettings settings;
  settings.server_address = s.control.substr(0, s.control.rfind(':'));
  settings.meta_port = static_cast<uint16_t>(ticket.meta_port());
  if (ticket.token().size() != settings.token.size())
    return absl::InternalError("the ticket's token has a wrong size");
  std::copy(ticket.token().begin(), ticket.token().end(), settings.token.begin());
  settings.client = {.width = static_cast<uint16_t>(s.width),
                     .height = static_cast<uint16_t>(s.height),
                     .fov = view_of(s).fov,
                     .display_hz = static_cast<float>(s.fps),
                     .name = "tessera-client"};
  return client::Connection::connect(settings, clock);
}

// Stands on the path, or at --position and looks around once in ten seconds.
class Head {
 public:
  static StatusOr<Head> create(const Settings& s) {
    Head head;
    head.still_.position = {s.position[0], s.position[1], s.position[2]};
    if (s.path.empty()) return head;
    TESSERA_ASSIGN_OR_RETURN(CameraPath path, CameraPath::load(s.path));
    head.path_ = std::move(path);
    return head;
  }
  Pose at(DurationNs t) const {
    if (path_) return path_->at(path_->poses().front().time_ns + t);
    Pose pose = still_;
    pose.orientation = glm::angleAxis(to_seconds(t) * 0.6283185307, dvec3(0, 1, 0));
    return pose;
  }

 private:
  std::optional<CameraPath> path_;
  Pose still_;
};

Status save(const Settings& s, const Image8& image, uint64_t index) {
  const std::string file = absl::StrFormat("%s/%06d.png", s.out, index);
  if (stbi_write_png(file.c_str(), static_cast<int>(image.width), static_cast<int>(image.height), 4,
                     image.rgba.data(), static_cast<int>(4 * image.width)))
    return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("cannot write ", file));
}

class Viewer {
 public:
  Viewer(const Settings& s, Head head, client::Connection& connection, client::Display& display,
         const Clock& clock)
      : s_(s),
        head_(std::move(head)),
        connection_(connection),
        display_(display),
        clock_(clock),
        view_(view_of(s)) {}

  // The path begins with the first pair.
  Status run() {
    constexpr DurationNs kPatienceNs = 30 * kNsPerSecond;
    const DurationNs interval = from_seconds(1 / s_.fps);
    const TimeNs give_up = clock_.now() + kPatienceNs;
    std::optional<TimeNs> start;
    for (TimeNs tick = clock_.now();; tick = std::max(tick + interval, clock_.now() - interval)) {
      std::this_thread::sleep_for(std::chrono::nanoseconds(tick - clock_.now()));
      TESSERA_RETURN_IF_ERROR(connection_.status());
      const TimeNs now = clock_.now();
      if (start && now - *start > from_seconds(s_.seconds)) return absl::OkStatus();
      if (!start && now > give_up) return absl::DeadlineExceededError("no picture within 30 s");
      view_.pose = head_.at(start ? now - *start : 0);
      connection_.send_pose({now, view_.pose});
      TESSERA_RETURN_IF_ERROR(show());
      if (!start && pair_) start = now;
    }
  }
  const Totals& totals() const { return totals_; }

 private:
  Status show() {
    const client::Pair* next = connection_.take_newest();
    if (next) {
      pair_ = next;
      TESSERA_RETURN_IF_ERROR(display_.set_state(next->state));
      TESSERA_RETURN_IF_ERROR(display_.set_atlas(codec::view_of(next->atlas)));
    }
    if (!pair_) return absl::OkStatus();
    TESSERA_ASSIGN_OR_RETURN(const Image8 image, display_.draw(view_));
    if (next) {
      connection_.report_displayed(next->frame, clock_.now());
      ++totals_.fresh;
    }
    if (!s_.out.empty() && totals_.displayed % s_.save_every == 0) {
      TESSERA_RETURN_IF_ERROR(save(s_, image, totals_.displayed));
      ++totals_.pictures;
    }
    ++totals_.displayed;
    return absl::OkStatus();
  }

  const Settings& s_;
  Head head_;
  client::Connection& connection_;
  client::Display& display_;
  const Clock& clock_;
  View view_;
  const client::Pair* pair_ = nullptr;
  Totals totals_;
};

StatusOr<nlohmann::json> view(const Settings& s) {
  const SteadyClock clock;
  TESSERA_ASSIGN_OR_RETURN(Head head, Head::create(s));
  if (!s.out.empty()) {
    std::error_code error;
    std::filesystem::create_directories(s.out, error);
    if (error) return absl::UnavailableError(absl::StrCat("cannot make ", s.out, ": ", error.message()));
  }
  TESSERA_ASSIGN_OR_RETURN(const auto session, ControlledSession::create(s));
  TESSERA_ASSIGN_OR_RETURN(const auto connection, connect(s, session->ticket(), clock));
  TESSERA_ASSIGN_OR_RETURN(const auto display,
                           client::Display::create({.width = s.width, .height = s.height}));
  Viewer viewer(s, std::move(head), *connection, *display, clock);
  TESSERA_RETURN_IF_ERROR(viewer.run());
  const client::ConnectionStats stats = connection->stats();
  const Totals& totals = viewer.totals();
  return nlohmann::json{{"frames_displayed", totals.displayed},
                        {"frames_fresh", totals.fresh},
                        {"pictures", totals.pictures},
                        {"network_round_trip_ms", to_ms(stats.round_trip_ns.value_or(0))},
                        {"packets", stats.media.packets},
                        {"packets_recovered", stats.media.recovered},
                        {"packets_given_up", stats.media.given_up},
                        {"decode_errors", stats.core.decode_errors}};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Views a scene of a tesserad without a window.", "tessera-client");
  app.footer(kFooter);
  Settings s;
  std::string log_level = "warn";
  app.add_option("--control", s.control, "address:port of the daemon's gRPC, in numbers")
      ->capture_default_str();
  app.add_option("--scene", s.scene, "a scene that the daemon holds")->required();
  app.add_option("--path", s.path, "camera path (CSV); none: look around at --position")
      ->check(CLI::ExistingFile);
  app.add_option("--position", s.position, "x y z in metres")->expected(3)->capture_default_str();
  app.add_option("--seconds", s.seconds, "how long, from the first picture on")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--fps", s.fps, "display rate")->check(CLI::Range(1.0, 1000.0))->capture_default_str();
  app.add_option("--width", s.width, "pixels")->check(CLI::Range(2, 8192))->capture_default_str();
  app.add_option("--height", s.height, "pixels")->check(CLI::Range(2, 8192))->capture_default_str();
  app.add_option("--fov-y", s.fov_y_deg, "degrees")->check(CLI::Range(1.0, 179.0))->capture_default_str();
  app.add_option("--out", s.out, "folder for pictures (PNG); none: write none");
  app.add_option("--save-every", s.save_every, "n-th displayed frame")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--json", s.json, "write what was measured to this file; - for standard output");
  app.add_option("--log", log_level, "level on standard error")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  init_logging(log_level);
  const StatusOr<nlohmann::json> result = view(s);
  if (!result.ok()) {
    std::cerr << "tessera-client: " << result.status().message() << std::endl;
    return kFailed;
  }
  if (!s.json.empty() && s.json != "-") {
    std::ofstream(s.json) << result->dump(1) << "\n";
  } else {
    std::cout << result->dump(1) << std::endl;
  }
  return kOk;
}
