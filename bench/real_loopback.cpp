#include "bench/real_loopback.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <utility>

#include "base/camera_path.h"
#include "bench/image_io.h"
#include "bench/program.h"
#include "bench/scoring.h"
#include "bench/streamer.h"
#include "bench/temporary_folder.h"
#include "bench/truth_source.h"
#include "client-sdk/tools/made_ticket.h"
#include "proto/atlas_codec.h"
#include "proto/control_access.h"
#include "proto/frame_reader.h"
#include "scene/procedural.h"
#include "server/frame_plan.h"

namespace tessera::bench {
namespace {

v1::Layout to_proto(atlas::LayoutKind kind) {
  switch (kind) {
    case atlas::LayoutKind::blocks:
      return v1::LAYOUT_BLOCKS;
    case atlas::LayoutKind::coherent:
      return v1::LAYOUT_COHERENT;
    case atlas::LayoutKind::tessellated:
      return v1::LAYOUT_TESSELLATED;
  }
  return v1::LAYOUT_UNSPECIFIED;
}

using nlohmann::json;

constexpr std::chrono::milliseconds kPoll{20};
constexpr std::chrono::seconds kCallTimeout{10};
constexpr uint32_t kSpareWatchers = 4;  // beside one of each session's frames
constexpr size_t kLogTail = 2000;       // characters of a failed program's output that are shown

Status failed(const char* what, const Program& program, int code) {
  const std::string output = program.output();
  return absl::InternalError(absl::StrCat(what, " ended with ", code, ":\n",
                                          output.substr(output.size() - std::min(output.size(), kLogTail))));
}

// The line that tesserad logs once it serves.
std::optional<json> serving_line(const std::string& log) {
  std::istringstream in(log);
  for (std::string line; std::getline(in, line);) {
    json event = json::parse(line, nullptr, false);
    if (event.is_object() && event.value("event", "") == "serving") return event;
  }
  return std::nullopt;
}

Status write_path(const CameraPath& path, DurationNs start, const std::filesystem::path& file) {
  std::ofstream out(file);
  out << "t_seconds,px,py,pz,qx,qy,qz,qw\n" << std::setprecision(17);
  const TimeNs first = path.poses().front().time_ns + start;
  const auto line = [&](TimeNs t, const Pose& pose) {
    const auto& [p, q] = pose;
    out << to_seconds(t - first) << ',' << p.x << ',' << p.y << ',' << p.z << ',' << q.x << ',' << q.y << ','
        << q.z << ',' << q.w << '\n';
  };
  line(first, path.at(first));
  for (const TimedPose& pose : path.poses())
    if (pose.time_ns > first) line(pose.time_ns, pose.pose);
  return out.flush() ? absl::OkStatus()
                     : absl::UnavailableError(absl::StrCat("cannot write ", file.string()));
}

class RealLoopback {
 public:
  RealLoopback(const LoopbackSettings& settings, Progress& progress) : s_(settings), progress_(progress) {
    result_.settings = settings;
  }
  StatusOr<LoopbackResult> run();

 private:
  struct Viewer {
    v1::Ticket ticket;
    std::unique_ptr<FrameReader> frames;
    std::unique_ptr<Program> program;
    std::vector<FrameRecord> records;
    json report;  // the client's own
  };

  Status start_daemon();
  Status describe_daemon();
  Status start_viewer(uint32_t index);
  Status wait_for_viewers();
  Status end_daemon();
  Status score_pictures();
  Status score_picture(const json& saved, TruthSource& truth, const MaskedTriangles& masked,
                       ErrorMean& error);
  void keep(const char* label, const FramePictures& pictures, const Comparison& comparison);
  void fill_row(const Viewer& viewer, uint32_t session);
  std::filesystem::path file(const std::string& name) const { return folder_.path() / name; }

  const LoopbackSettings s_;
  Progress& progress_;
  LoopbackResult result_;
  TemporaryFolder folder_;
  std::unique_ptr<Program> daemon_;
  std::unique_ptr<v1::Control::Stub> control_;
  std::vector<Viewer> viewers_;
  double daemon_rss_mib_ = 0, scene_device_mib_ = 0;
  double worst_mssim_ = 2;
};

Status RealLoopback::start_daemon() {
  TESSERA_ASSIGN_OR_RETURN(
      daemon_, Program::start({.file = sibling_program("tesserad"),
                               .arguments = {"--scene",        "scene=" + s_.scene,
                                             "--device",       s_.device,
                                             "--gather",       std::string(shading::name_of(s_.gather)),
                                             "--control-port", "0",
                                             "--meta-port",    "0",
                                             "--media-port",   "0",
                                             "--http-port",    "0",
                                             "--max-sessions", absl::StrCat(s_.sessions),
                                             "--max-watchers", absl::StrCat(s_.sessions + kSpareWatchers),
                                             "--log-format",   "json"},
                               .log = file("tesserad.log")}));
  while (true) {
    if (const auto line = serving_line(daemon_->output())) {
      control_ = v1::Control::NewStub(
          grpc::CreateChannel(absl::StrCat("127.0.0.1:", line->at("control_port").get<int>()),
                              grpc::InsecureChannelCredentials()));
      return describe_daemon();
    }
    if (const auto code = daemon_->exit_code()) return failed("tesserad", *daemon_, *code);
    std::this_thread::sleep_for(kPoll);
  }
}

Status RealLoopback::describe_daemon() {
  grpc::ClientContext info_context, scenes_context;
  // The daemon listens, but gRPC 1.51 may give up its first connection all the same (see is_starting() in
  // client-sdk/tools/controlled_session.cpp). Later calls go over the same channel.
  info_context.set_wait_for_ready(true);
  info_context.set_deadline(std::chrono::system_clock::now() + kCallTimeout);
  v1::ServerInfo info;
  TESSERA_RETURN_IF_ERROR(to_status(control_->GetServerInfo(&info_context, {}, &info), "GetServerInfo"));
  result_.device = {info.device(), info.driver(), info.software_rendering()};
  result_.notes.push_back("encoder: " +
                          (s_.codec == AtlasCodec::h264 ? info.encoder() : std::string(name_of(s_.codec))));
  v1::ListScenesResponse scenes;
  TESSERA_RETURN_IF_ERROR(to_status(control_->ListScenes(&scenes_context, {}, &scenes), "ListScenes"));
  server::FramePlan plan;
  for (const v1::Pass& pass : scenes.scenes(0).plan())
    plan.passes.push_back({pass.name(), pass.included(), pass.reason()});
  result_.plan = plan.to_string();
  scene_device_mib_ = scenes.scenes(0).device_mib();
  return absl::OkStatus();
}

Status RealLoopback::start_viewer(uint32_t index) {
  Viewer& viewer = viewers_.emplace_back();
  grpc::ClientContext context;
  v1::CreateSessionRequest request;
  request.set_scene("scene");
  request.mutable_settings()->set_atlas_width(s_.atlas.width);
  request.mutable_settings()->set_atlas_height(s_.atlas.height);
  request.mutable_settings()->set_layout(to_proto(s_.layout));
  request.mutable_settings()->set_codec(to_proto(s_.codec));
  request.mutable_settings()->set_bitrate_mbps(s_.bitrate_mbps);
  request.mutable_settings()->set_frames_per_second(s_.server_fps);
  TESSERA_RETURN_IF_ERROR(
      to_status(control_->CreateSession(&context, request, &viewer.ticket), "CreateSession"));
  TESSERA_ASSIGN_OR_RETURN(const client::Ticket ticket, client::ticket_of(viewer.ticket, "127.0.0.1"));
  viewer.frames = std::make_unique<FrameReader>(*control_, viewer.ticket.session());
  std::vector<std::string> arguments{"--path",    file("path.csv"),
                                     "--seconds", absl::StrCat(s_.seconds),
                                     "--fps",     absl::StrCat(s_.fps),
                                     "--width",   absl::StrCat(s_.size.width),
                                     "--height",  absl::StrCat(s_.size.height),
                                     "--fov-y",   absl::StrCat(s_.fov_y_deg),
                                     "--json",    file(absl::StrCat("client", index, ".json"))};
  if (index == 0) {
    const std::string pictures = file("pictures");
    arguments.insert(arguments.end(), {"--out", pictures, "--save-every", absl::StrCat(s_.score_every)});
  }
  TESSERA_ASSIGN_OR_RETURN(viewer.program,
                           Program::start({.file = sibling_program("tessera-client"),
                                           .arguments = arguments,
                                           .environment = {"TESSERA_TICKET=" + client::to_string(ticket)},
                                           .log = file(absl::StrCat("client", index, ".log"))}));
  return absl::OkStatus();
}

Status RealLoopback::wait_for_viewers() {
  for (size_t i = 0; i < viewers_.size(); ++i) {
    Viewer& viewer = viewers_[i];
    while (!viewer.program->exit_code()) {
      if (const auto code = daemon_->exit_code()) return failed("tesserad", *daemon_, *code);
      std::this_thread::sleep_for(kPoll);
    }
    if (const int code = *viewer.program->exit_code(); code != 0)
      return failed("tessera-client", *viewer.program, code);
    viewer.report = json::parse(std::ifstream(file(absl::StrCat("client", i, ".json"))), nullptr, false);
    if (!viewer.report.is_object()) return absl::InternalError("tessera-client left no result");
    TESSERA_ASSIGN_OR_RETURN(viewer.records,
                             viewer.frames->finish(viewer.report.value("newest_frame", FrameNumber{0})));
  }
  return absl::OkStatus();
}

Status RealLoopback::end_daemon() {
  daemon_rss_mib_ = daemon_->peak_rss_mib();
  if (const int code = daemon_->end(); code != 0) return failed("tesserad", *daemon_, code);
  return absl::OkStatus();
}

Status RealLoopback::score_pictures() {
  TESSERA_ASSIGN_OR_RETURN(const auto device,
                           gpu::Device::create({.select = s_.device, .validation = s_.validation}));
  TESSERA_ASSIGN_OR_RETURN(const auto scene, scene::load_scene(s_.scene));
  TESSERA_ASSIGN_OR_RETURN(const auto shared, server::SharedScene::create(device, scene));
  TESSERA_ASSIGN_OR_RETURN(const auto truth,
                           TruthSource::create(shared, s_.scene, "none", s_.truth == Truth::one ? 1 : 4));
  const MaskedTriangles masked(*scene);
  const json& saved = viewers_[0].report.at("saved");
  ErrorMean error;
  progress_.begin("scored pictures", saved.size());
  for (const json& picture : saved) {
    TESSERA_RETURN_IF_ERROR(score_picture(picture, *truth, masked, error));
    progress_.advance();
  }
  result_.rows[0].error = error.mean();
  return absl::OkStatus();
}

// The scene has moved on since the frame was rendered, by the time that the frame was under way.
Status RealLoopback::score_picture(const json& saved, TruthSource& truth, const MaskedTriangles& masked,
                                   ErrorMean& error) {
  const auto& records = viewers_[0].records;
  const auto frame = saved.at("frame").get<FrameNumber>();
  const auto displayed = saved.at("displayed_ns").get<TimeNs>();
  const auto record = std::ranges::find(records, frame, &FrameRecord::frame);
  if (record == records.end() || record->client.clock_error < 0) return absl::OkStatus();
  const auto p = saved.at("position"), q = saved.at("orientation_xyzw");
  View view = client_view(s_);
  view.pose = {dvec3(p[0], p[1], p[2]),
               dquat(q[3].get<double>(), q[0].get<double>(), q[1].get<double>(), q[2].get<double>())};
  const TimeNs scene_time =
      record->scene_time + displayed + record->client.clock_offset - record->server.render_begin;

  FramePictures pictures{.index = saved.at("index").get<uint32_t>()};
  TESSERA_ASSIGN_OR_RETURN(pictures.truth, truth.truth(view, scene_time));
  TESSERA_ASSIGN_OR_RETURN(Image8 shown, read_png(saved.at("file").get<std::string>()));
  pictures.shown.push_back(std::move(shown));
  const FrameScore scored = score(pictures, masked);
  const Comparison& comparison = scored.methods[0];
  error.add(comparison.error);
  DisplayRecord display{.time_ns = from_seconds(pictures.index / s_.fps),
                        .frame = frame,
                        .age_ms = to_ms(displayed - record->pose_time),
                        .atlas_bytes = record->atlas_bytes,
                        .meta_bytes = record->meta_bytes};
  display.mssim["tessera"] = comparison.error.mssim;
  display.psnr["tessera"] = comparison.error.psnr;
  result_.frames.push_back(std::move(display));
  if (result_.pictures.empty()) keep("first", pictures, comparison);
  if (comparison.error.mssim < worst_mssim_) {
    worst_mssim_ = comparison.error.mssim;
    keep("worst", pictures, comparison);
  }
  return absl::OkStatus();
}

void RealLoopback::keep(const char* label, const FramePictures& pictures, const Comparison& comparison) {
  std::erase_if(result_.pictures, [&](const Picture& kept) { return kept.label == label; });
  result_.pictures.push_back({label, "", pictures.index, comparison.error.mssim, pictures.truth->color,
                              pictures.shown[0], comparison.ssim});
}

void RealLoopback::fill_row(const Viewer& viewer, uint32_t session) {
  Row row{.method = "tessera", .session = session};
  row.frames_displayed = viewer.report.at("frames_displayed");
  row.frames_stale = row.frames_displayed - viewer.report.at("frames_fresh").get<uint64_t>();
  uint64_t atlas = 0, meta = 0, shown = 0;
  double server_ms = 0, draw_ms = 0;
  for (const FrameRecord& r : viewer.records) {
    atlas += r.atlas_bytes, meta += r.meta_bytes;
    server_ms += to_ms(r.server.stages());
    if (!r.client.displayed) continue;
    ++shown;
    draw_ms += to_ms(r.client.displayed - r.client.draw_begin);
  }
  const auto& records = viewer.records;
  if (records.size() > 1) {
    const double seconds =
        to_seconds(records.back().server.render_begin - records.front().server.render_begin) *
        static_cast<double>(records.size()) / static_cast<double>(records.size() - 1);
    row.mbps_atlas = 8e-6 * static_cast<double>(atlas) / seconds;
    row.mbps_meta = 8e-6 * static_cast<double>(meta) / seconds;
    row.mbps_total = row.mbps_atlas + row.mbps_meta;
    row.server_fps = static_cast<double>(records.size()) / seconds;
    row.server_ms = server_ms / static_cast<double>(records.size());
    row.frames_lost = records.back().frame - records.front().frame + 1 - shown;
  }
  row.client_ms = draw_ms / static_cast<double>(std::max<uint64_t>(shown, 1));
  row.peak_rss_mib = daemon_rss_mib_;
  row.device_mib = scene_device_mib_;
  // Measuring begins with the first picture, as scoring does; the frame that brings it has a session to set
  // up.
  const auto first =
      std::ranges::find_if(records, [](const FrameRecord& r) { return durations(r).has_value(); });
  if (first != records.end()) {
    row.first_picture_ms = to_ms(durations(*first)->end_to_end);
    add_durations({first + 1, records.end()}, row);
  }
  result_.rows.push_back(std::move(row));
}

StatusOr<LoopbackResult> RealLoopback::run() {
  if (folder_.path().empty()) return absl::UnavailableError("cannot make a temporary folder");
  TESSERA_ASSIGN_OR_RETURN(const CameraPath path, scene::load_path(s_.path));
  TESSERA_RETURN_IF_ERROR(write_path(path, from_seconds(s_.start_s), file("path.csv")));
  progress_.estimate(s_.seconds);
  if (s_.estimate_only) return std::move(result_);
  TESSERA_RETURN_IF_ERROR(start_daemon());
  viewers_.reserve(s_.sessions);
  for (uint32_t i = 0; i < s_.sessions; ++i) TESSERA_RETURN_IF_ERROR(start_viewer(i));
  TESSERA_RETURN_IF_ERROR(wait_for_viewers());
  TESSERA_RETURN_IF_ERROR(end_daemon());
  for (uint32_t i = 0; i < s_.sessions; ++i) {
    fill_row(viewers_[i], i);
    result_.records.insert(result_.records.end(), viewers_[i].records.begin(), viewers_[i].records.end());
  }
  TESSERA_RETURN_IF_ERROR(score_pictures());
  return std::move(result_);
}

}  // namespace

StatusOr<LoopbackResult> run_real_loopback(const LoopbackSettings& settings, Progress& progress) {
  return RealLoopback(settings, progress).run();
}

}  // namespace tessera::bench
