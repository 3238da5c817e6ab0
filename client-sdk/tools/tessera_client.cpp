// tessera-client: a viewer without a window. Follows a path, draws the newest pair at the newest pose, writes
// pictures.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/camera_path.h"
#include "base/frame_trace.h"
#include "base/log.h"
#include "client-sdk/connection.h"
#include "client-sdk/display.h"
#include "client-sdk/ticket.h"
#include "client-sdk/tools/controlled_session.h"
#include "client-sdk/tools/picture_writer.h"
#include "codec/yuv.h"
#include "proto/atlas_codec.h"

namespace {

using namespace tessera;

constexpr DurationNs kConnectTimeoutNs = 8 * kNsPerSecond;

enum ExitCode { kOk = 0, kFailed = 1, kUsage = 2 };

constexpr char kFooter[] = R"(Examples:
  tessera-client --scene hall --position 0 1.6 0 --seconds 5 --out pictures
  tessera-client --control 127.0.0.1:7310 --scene sponza --path sponza_1.csv --width 1280 --height 720 --save-every 10 --json run.json
  tessera-client --scene hall --out hall.mp4 --trace hall-trace.json
  tessera-client --scene hall --stereo --foveation 1 --fov-y 90 --out pictures
  tessera-client --control render.example:7310 --ca ca.pem --control-token-file token --scene hall --print-ticket
  tessera-client --ticket tessera://127.0.0.1:7311/TOKEN --out pictures

Exit codes: 0 done, 1 the stream failed, 2 wrong usage.)";

struct Settings {
  client::ControlSettings control;
  AtlasCodec codec = AtlasCodec::h264;
  std::string scene, ticket, path, out, json, frames_csv, trace;
  bool print_ticket = false, stereo = false;
  double eye_distance_mm = 63, foveation = 0;
  std::optional<double> bias;
  std::vector<double> position;
  double seconds = 5, fps = 60, fov_y_deg = 60;
  uint32_t width = 960, height = 540, save_every = 30;
};

struct Totals {
  uint64_t displayed = 0, fresh = 0;
  nlohmann::json saved = nlohmann::json::array();  // what each picture shows
};

View view_of(const Settings& s) {
  View view;
  view.width = s.width;
  view.height = s.height;
  view.fov = Fov::symmetric(static_cast<float>(s.fov_y_deg * 3.14159265358979 / 180),
                            static_cast<float>(s.width) / static_cast<float>(s.height));
  return view;
}

std::vector<Eye> eyes_of(const Settings& s) {
  const Fov fov = view_of(s).fov;
  if (!s.stereo) return {{.fov = fov}};
  const double half_m = 0.5e-3 * s.eye_distance_mm;
  return {{.in_head = {.position = {-half_m, 0, 0}}, .fov = fov},
          {.in_head = {.position = {half_m, 0, 0}}, .fov = fov}};
}

// What a session is asked for; zeros leave the daemon its defaults.
v1::SessionSettings session_settings(const Settings& s) {
  v1::SessionSettings wanted;
  wanted.mutable_density()->set_foveation(s.foveation);
  if (s.bias) wanted.mutable_density()->set_bias(*s.bias);
  wanted.set_codec(to_proto(s.codec));
  return wanted;
}

Image8 beside(const Image8& left, const Image8& right) {
  Image8 both(left.width + right.width, left.height);
  for (uint32_t y = 0; y < left.height; ++y) {
    std::copy_n(left.at(0, y), size_t{4} * left.width, both.at(0, y));
    std::copy_n(right.at(0, y), size_t{4} * right.width, both.at(left.width, y));
  }
  return both;
}

transport::ClientSettings client_settings(const Settings& s) {
  return {.width = static_cast<uint16_t>(s.width),
          .height = static_cast<uint16_t>(s.height),
          .eyes = eyes_of(s),
          .display_hz = static_cast<float>(s.fps),
          .name = "tessera-client"};
}

// Follows the path; or stands at --position and looks around; or walks around the whole scene, looking in.
// Once around takes ten seconds.
class Head {
 public:
  // `session` knows the scene; null: it cannot be asked.
  static StatusOr<Head> create(const Settings& s, client::ControlledSession* session) {
    Head head;
    if (!s.path.empty()) {
      TESSERA_ASSIGN_OR_RETURN(CameraPath path, CameraPath::load(s.path));
      head.path_ = std::move(path);
    } else if (!s.position.empty()) {
      head.center_ = {s.position[0], s.position[1], s.position[2]};
    } else if (session) {
      TESSERA_ASSIGN_OR_RETURN(const v1::Box box, session->bounds());
      const dvec3 low(box.min_x(), box.min_y(), box.min_z()), high(box.max_x(), box.max_y(), box.max_z());
      head.center_ = (low + high) / 2.0;
      // The ball around the scene fits into the narrower field of view.
      const Fov fov = view_of(s).fov;
      head.distance_ =
          0.5 * glm::length(high - low) / std::sin(0.5 * std::min(fov.width_rad(), fov.height_rad()));
    }
    return head;
  }
  Pose at(DurationNs t) const {
    if (path_) return path_->at(path_->poses().front().time_ns + t);
    const dquat turn = glm::angleAxis(to_seconds(t) * 0.6283185307, dvec3(0, 1, 0));
    return {center_ + turn * dvec3(0, 0, distance_), turn};
  }

 private:
  std::optional<CameraPath> path_;
  dvec3 center_{0, 1.6, 0};
  double distance_ = 0;  // from the centre, backwards
};

class Viewer {
 public:
  // `writer` may be null.
  Viewer(const Settings& s, Head head, client::Connection& connection, client::Display& display,
         client::PictureWriter* writer, const Clock& clock)
      : s_(s),
        head_(std::move(head)),
        connection_(connection),
        display_(display),
        writer_(writer),
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
  // That it showed.
  std::optional<FrameNumber> newest() const { return pair_ ? std::optional(pair_->frame) : std::nullopt; }

 private:
  Status show() {
    const client::Pair* next = connection_.take_newest();
    if (next) {
      pair_ = next;
      TESSERA_RETURN_IF_ERROR(display_.set_state(next->state));
      TESSERA_RETURN_IF_ERROR(display_.set_atlas(codec::view_of(next->atlas)));
    }
    if (!pair_) return absl::OkStatus();
    TESSERA_ASSIGN_OR_RETURN(const Image8 image, draw());
    const TimeNs displayed = clock_.now();
    if (next) {
      connection_.report_displayed(next->frame, displayed);
      ++totals_.fresh;
    }
    if (writer_) TESSERA_RETURN_IF_ERROR(save(image, displayed));
    ++totals_.displayed;
    return absl::OkStatus();
  }

  // Two eyes lie side by side.
  StatusOr<Image8> draw() {
    std::vector<View> views;
    for (const Eye& eye : eyes_of(s_)) {
      View& view = views.emplace_back(view_);
      view.pose = compose(view_.pose, eye.in_head);
    }
    if (views.size() == 1) return display_.draw(views[0]);
    TESSERA_ASSIGN_OR_RETURN(const client::Display::StereoImage eyes,
                             display_.draw_stereo(views[0], views[1]));
    return beside(eyes.left, eyes.right);
  }

  Status save(const Image8& image, TimeNs displayed) {
    TESSERA_ASSIGN_OR_RETURN(const std::string file, writer_->write(image, totals_.displayed));
    if (file.empty()) return absl::OkStatus();
    const auto& [position, q] = view_.pose;
    totals_.saved.push_back({{"file", file},
                             {"index", totals_.displayed},
                             {"frame", pair_->frame},
                             {"displayed_ns", displayed},
                             {"position", {position.x, position.y, position.z}},
                             {"orientation_xyzw", {q.x, q.y, q.z, q.w}}});
    return absl::OkStatus();
  }

  const Settings& s_;
  Head head_;
  client::Connection& connection_;
  client::Display& display_;
  client::PictureWriter* writer_;
  const Clock& clock_;
  View view_;
  const client::Pair* pair_ = nullptr;
  Totals totals_;
};

Status print_ticket(const Settings& s) {
  TESSERA_ASSIGN_OR_RETURN(const auto session,
                           client::ControlledSession::create(s.control, s.scene, session_settings(s)));
  session->keep();
  std::cout << client::to_string(session->ticket()) << std::endl;
  std::string tls = " -plaintext";
  if (s.control.authority_file)
    tls = s.control.authority_file->empty() ? "" : absl::StrCat(" -cacert ", *s.control.authority_file);
  std::cerr << absl::StrFormat(
      "session %u ends when it has no client for the daemon's --idle-timeout, or is deleted: grpcurl%s -d "
      "'{\"session\": %u}' %s "
      "tessera.v1.Control/DeleteSession\n",
      session->id(), tls, session->id(), s.control.endpoint);
  return absl::OkStatus();
}

Status write_frames(const Settings& s, const std::vector<FrameRecord>& records) {
  using Write = void (*)(std::span<const FrameRecord>, std::ostream&);
  for (const auto& [file, write] :
       {std::pair<std::string, Write>(s.frames_csv, write_csv), {s.trace, write_chrome_trace}}) {
    if (file.empty()) continue;
    std::ofstream out(file);
    write(records, out);
    if (!out.flush()) return absl::UnavailableError(absl::StrCat("cannot write ", file));
  }
  return absl::OkStatus();
}

StatusOr<nlohmann::json> view(const Settings& s) {
  const SteadyClock clock;
  std::unique_ptr<client::PictureWriter> writer;
  if (!s.out.empty()) {
    TESSERA_ASSIGN_OR_RETURN(
        writer, client::make_picture_writer({.out = s.out, .save_every = s.save_every, .fps = s.fps}));
  }
  std::unique_ptr<client::ControlledSession> session;  // of this program's own, for its lifetime
  client::Ticket ticket;
  if (!s.ticket.empty()) {
    TESSERA_ASSIGN_OR_RETURN(ticket, client::parse_ticket(s.ticket));
  } else {
    TESSERA_ASSIGN_OR_RETURN(session,
                             client::ControlledSession::create(s.control, s.scene, session_settings(s)));
    ticket = session->ticket();
    if (!s.frames_csv.empty() || !s.trace.empty()) session->record_frames();
  }
  TESSERA_ASSIGN_OR_RETURN(Head head, Head::create(s, session.get()));
  TESSERA_ASSIGN_OR_RETURN(const auto connection,
                           client::connect(ticket, client_settings(s), kConnectTimeoutNs, clock));
  TESSERA_ASSIGN_OR_RETURN(const auto display,
                           client::Display::create({.width = s.width, .height = s.height}));
  Viewer viewer(s, std::move(head), *connection, *display, writer.get(), clock);
  TESSERA_RETURN_IF_ERROR(viewer.run());
  if (writer) TESSERA_RETURN_IF_ERROR(writer->finish());
  if (session) {
    TESSERA_ASSIGN_OR_RETURN(const std::vector<FrameRecord> frames, session->frames(viewer.newest()));
    TESSERA_RETURN_IF_ERROR(write_frames(s, frames));
  }
  const client::ConnectionStats stats = connection->stats();
  const Totals& totals = viewer.totals();
  return nlohmann::json{{"frames_displayed", totals.displayed},
                        {"newest_frame", viewer.newest().value_or(0)},
                        {"frames_fresh", totals.fresh},
                        {"pictures", writer ? writer->written() : 0},
                        {"saved", totals.saved},
                        {"network_round_trip_ms", to_ms(stats.round_trip_ns.value_or(0))},
                        {"packets", stats.media.packets},
                        {"packets_recovered", stats.media.recovered},
                        {"packets_given_up", stats.media.given_up},
                        {"orphans", stats.core.orphans},
                        {"decode_errors", stats.core.decode_errors}};
}

Status run(const Settings& s) {
  if (s.print_ticket) return print_ticket(s);
  TESSERA_ASSIGN_OR_RETURN(const nlohmann::json result, view(s));
  if (s.json.empty() || s.json == "-") {
    std::cout << result.dump(1) << std::endl;
    return absl::OkStatus();
  }
  if (std::ofstream(s.json) << result.dump(1) << std::endl) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("cannot write ", s.json));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Views a scene of a tesserad without a window.", "tessera-client");
  app.footer(kFooter);
  Settings s;
  std::string log_level = "warn";
  app.add_option("--control", s.control.endpoint, "host:port of the daemon's gRPC")->capture_default_str();
  CLI::Option* authority = app.add_option(
      "--ca", s.control.authority_file,
      "TLS: who signed the server's certificate (PEM; '': whom the system trusts), for control and session");
  app.add_option("--control-token-file", s.control.token_file,
                 "its first line is the secret that the daemon's control port wants")
      ->envname("TESSERA_CONTROL_TOKEN_FILE");
  app.add_flag("--insecure", s.control.insecure, "send the control token in clear text beyond loopback");
  CLI::Option* scene =
      app.add_option("--scene", s.scene, "view a scene that the daemon holds, in a new session");
  std::vector<std::string> codecs;
  for (const auto& [codec, name] : kAtlasCodecs) codecs.emplace_back(name);
  app.add_option_function<std::string>(
         "--codec", [&s](const std::string& name) { s.codec = *atlas_codec_from(name); },
         "with --scene: how the new session codes its atlas")
      ->check(CLI::IsMember(codecs))
      ->default_str(std::string(name_of(s.codec)))
      ->needs(scene);
  app.add_option("--ticket", s.ticket, "view the session of this ticket: tessera://HOST:PORT/TOKEN[?ca=FILE]")
      ->envname("TESSERA_TICKET")
      ->excludes(scene)
      ->excludes(authority);
  app.add_flag("--print-ticket", s.print_ticket,
               "print the new session's ticket, a secret, and leave it to an app")
      ->needs(scene);
  CLI::Option* path = app.add_option("--path", s.path, "camera path (CSV): t_seconds,px,py,pz,qx,qy,qz,qw")
                          ->check(CLI::ExistingFile);
  app.add_option(
         "--position", s.position,
         "stand here (x y z in metres) and look around; neither this nor --path: walk around the scene")
      ->expected(3)
      ->excludes(path);
  app.add_option("--seconds", s.seconds, "how long, from the first picture on")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  app.add_option("--fps", s.fps, "display rate")->check(CLI::Range(1.0, 1000.0))->capture_default_str();
  app.add_option("--width", s.width, "pixels")->check(CLI::Range(2, 8192))->capture_default_str();
  app.add_option("--height", s.height, "pixels")->check(CLI::Range(2, 8192))->capture_default_str();
  app.add_option("--fov-y", s.fov_y_deg, "degrees")->check(CLI::Range(1.0, 179.0))->capture_default_str();
  app.add_flag("--stereo", s.stereo, "two eyes, of --width and --height each, side by side in pictures");
  app.add_option("--eye-distance-mm", s.eye_distance_mm, "between them")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  app.add_option(
         "--foveation", s.foveation,
         "with --scene: shade for the eye's resolution away from the middle of the picture; 0: no, 1: as "
         "an eye sees, up to 8 times coarser")
      ->check(CLI::Range(0.0, 8.0))
      ->needs(scene)
      ->capture_default_str();
  app.add_option("--bias", s.bias,
                 "with --scene: 2^-BIAS samples a pixel; default: as many as the atlas has room for")
      ->check(CLI::Range(-2.0, 16.0))
      ->needs(scene);
  app.add_option("--out", s.out,
                 "folder for pictures (PNG), or a .mp4 file of all (by ffmpeg); none: write none");
  app.add_option("--save-every", s.save_every, "n-th displayed frame becomes a PNG")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  app.add_option("--json", s.json, "write what was measured to this file; - for standard output");
  app.add_option("--frames-csv", s.frames_csv,
                 "with --scene: a line for every frame, with the times of both ends")
      ->needs(scene);
  app.add_option("--trace", s.trace,
                 "with --scene: the same as a trace for Perfetto or chrome://tracing (JSON)")
      ->needs(scene);
  app.add_option("--log", log_level, "level on standard error")->capture_default_str();
  try {
    app.parse(argc, argv);
    if (s.scene.empty() && s.ticket.empty()) throw CLI::RequiredError("--scene or --ticket");
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  init_logging(log_level);
  std::signal(SIGPIPE, SIG_IGN);  // an ffmpeg that ends is an error of its picture
  if (s.control.authority_file && !s.control.authority_file->empty())  // a printed ticket is read elsewhere
    s.control.authority_file = std::filesystem::absolute(*s.control.authority_file);
  if (const Status status = run(s); !status.ok()) {
    std::cerr << "tessera-client: " << status.message() << std::endl;
    return kFailed;
  }
  return kOk;
}
