#include "server/metrics.h"

#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <utility>

namespace tessera::server {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

constexpr double kMib = 1 << 20;

// Of counters or gauges, taken from elsewhere at the time of the scrape.
struct Family : MetricFamily {
  Family(MetricType kind, const char* family, const char* meaning)
      : MetricFamily{family, meaning, kind, {}} {}
  template <class Value>
  Family& add(Value value, Labels labels = {}) {
    ClientMetric& sample = metric.emplace_back();
    sample.label = std::move(labels);
    (type == MetricType::Counter ? sample.counter.value : sample.gauge.value) = static_cast<double>(value);
    return *this;
  }
};

Family counter(const char* name, const char* help) {
  return {MetricType::Counter, name, help};
}
Family gauge(const char* name, const char* help) {
  return {MetricType::Gauge, name, help};
}

std::string code_name(int code) {
  return absl::StatusCodeToString(static_cast<absl::StatusCode>(code));
}

uint64_t resident_bytes() {
  std::ifstream in("/proc/self/statm");
  uint64_t total = 0, resident = 0;
  in >> total >> resident;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

// Of the sessions that run and of those that ended, so that it never falls.
template <class Field>
double sum(const StreamServerStats& stats, Field field) {
  auto total = static_cast<double>(field(stats.ended));
  for (const auto& [id, session] : stats.sessions) total += static_cast<double>(field(session));
  return total;
}

void add_streams(const StreamServerStats& s, std::vector<MetricFamily>& out) {
  const auto total = [&](const char* name, const char* help, auto field) {
    out.push_back(counter(name, help).add(sum(s, field)));
  };
  size_t connected = 0;
  for (const auto& [id, session] : s.sessions) connected += session.connected ? 1 : 0;
  out.push_back(gauge("tesserad_sessions", "Sessions, with and without a client.").add(s.sessions.size()));
  out.push_back(gauge("tesserad_clients_connected", "Sessions whose client is connected.").add(connected));
  out.push_back(gauge("tesserad_atlas_texels", "Texels of all sessions' atlases.").add(s.atlas_texels));
  using Stats = StreamedSessionStats;
  total("tesserad_frames_sent_total", "Frames rendered and sent.",
        [](const Stats& x) { return x.frames_sent; });
  total("tesserad_frames_skipped_total", "Frames given up before rendering, as the network was behind.",
        [](const Stats& x) { return x.frames_skipped; });
  total("tesserad_key_frames_total", "Key frames among the frames sent.",
        [](const Stats& x) { return x.key_frames; });
  total("tesserad_key_frame_requests_total", "Key frames that clients asked for.",
        [](const Stats& x) { return x.media.key_frame_requests; });
  out.push_back(counter("tesserad_sent_bytes_total", "Bytes sent, by kind; RTP headers included.")
                    .add(sum(s, [](const Stats& x) { return x.media.bytes; }), {{"kind", "video"}})
                    .add(sum(s, [](const Stats& x) { return x.media.retransmitted_bytes; }),
                         {{"kind", "retransmission"}})
                    .add(sum(s, [](const Stats& x) { return x.meta_bytes; }), {{"kind", "geometry"}}));
  total("tesserad_packets_sent_total", "RTP packets of video, each once.",
        [](const Stats& x) { return x.media.packets; });
  total("tesserad_packets_retransmitted_total", "RTP packets sent again.",
        [](const Stats& x) { return x.media.retransmitted; });
  out.push_back(
      counter("tesserad_dropped_datagrams_total", "UDP datagrams that were dropped, by reason.")
          .add(s.binding.unknown_address, {{"reason", "unknown_address"}})
          .add(s.binding.bad_token, {{"reason", "bad_token"}})
          .add(s.binding.malformed, {{"reason", "malformed"}})
          .add(sum(s, [](const Stats& x) { return x.media.malformed_rtcp; }), {{"reason", "malformed_rtcp"}})
          .add(s.dropped_datagrams, {{"reason", "send_queue_full"}}));
}

void add_each_session(const StreamServerStats& s, std::vector<MetricFamily>& out) {
  const auto each = [&](Family family, auto value) {
    for (const auto& [id, session] : s.sessions) family.add(value(session), {{"session", absl::StrCat(id)}});
    out.push_back(family);
  };
  using Stats = StreamedSessionStats;
  each(gauge("tesserad_session_connected", "1 while the session's client is connected."),
       [](const Stats& x) { return x.connected ? 1 : 0; });
  each(gauge("tesserad_session_bits_per_second", "Bit rate of the last second, geometry and video."),
       [](const Stats& x) { return x.bitrate_bps; });
  each(gauge("tesserad_session_round_trip_seconds", "From a pose to the picture that shows its frame."),
       [](const Stats& x) { return to_seconds(x.round_trip_ns); });
  each(gauge("tesserad_session_loss_ratio",
             "Packets lost before retransmission, as the client last reported."),
       [](const Stats& x) { return x.peer ? x.peer->loss : 0; });
  each(gauge("tesserad_session_atlas_used_ratio", "Share of the atlas that holds samples."),
       [](const Stats& x) { return x.share(x.layout.used_texels); });
  each(gauge("tesserad_session_atlas_fragmented_ratio",
             "Share of the atlas that neither is in use nor would take patches of every size."),
       [](const Stats& x) { return x.share(x.layout.fragmented_texels); });
  each(
      gauge(
          "tesserad_session_atlas_bias",
          "2^-bias samples a pixel are aimed at, before foveation and the like; above 0 the atlas is small."),
      [](const Stats& x) { return x.layout.bias; });
  each(gauge("tesserad_session_atlas_patches_without_place",
             "Patches (triangles, if each is placed) that are a single colour for want of memory."),
       [](const Stats& x) { return x.layout.colors_out_of_memory; });
  each(counter("tesserad_session_frames_sent_total", "Frames rendered and sent, by session."),
       [](const Stats& x) { return x.frames_sent; });
  each(counter("tesserad_session_frames_skipped_total", "Frames given up before rendering, by session."),
       [](const Stats& x) { return x.frames_skipped; });
}

void add_refusals(const StreamServerStats& s, const ControlService::Refusals& calls,
                  std::vector<MetricFamily>& out) {
  Family family =
      counter("tesserad_refusals_total", "Calls and clients that were refused, by call and reason.");
  for (const auto& [key, count] : calls)
    family.add(count, {{"call", key.first}, {"reason", code_name(key.second)}});
  for (const auto& [code, count] : s.refused_clients)
    family.add(count, {{"call", "connect"}, {"reason", code_name(static_cast<int>(code))}});
  out.push_back(family);
}

void add_scenes(const std::vector<SceneInfo>& scenes, std::vector<MetricFamily>& out) {
  double mib = 0;
  for (const SceneInfo& scene : scenes) mib += scene.device_mib;
  out.push_back(gauge("tesserad_scenes", "Scenes that are loaded.").add(scenes.size()));
  out.push_back(gauge("tesserad_scene_device_bytes", "Device memory of all scenes.").add(mib * kMib));
}

}  // namespace

struct Metrics::Impl {
  explicit Impl(const v1::ServerInfo& i) : info(i) {}

  prometheus::Histogram& stage(const char* name) {
    return stages.Add({{"stage", name}},
                      prometheus::Histogram::BucketBoundaries{0.0005, 0.001, 0.002, 0.004, 0.008, 0.016,
                                                              0.033, 0.066, 0.13, 0.26, 1});
  }
  void add_server(std::vector<MetricFamily>& out) const;

  const v1::ServerInfo info;
  const double start =
      std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
  prometheus::Registry registry;
  prometheus::Family<prometheus::Histogram>& stages = prometheus::BuildHistogram()
                                                          .Name("tesserad_render_stage_seconds")
                                                          .Help("Wall time of each stage of a frame.")
                                                          .Register(registry);
  prometheus::Histogram &visibility = stage("visibility"), &layout = stage("layout"),
                        &shading = stage("shading"), &encode = stage("encode");
};

void Metrics::Impl::add_server(std::vector<MetricFamily>& out) const {
  out.push_back(
      gauge("tesserad_build_info", "1, labelled with what runs.")
          .add(1, {{"version", info.version()}, {"device", info.device()}, {"encoder", info.encoder()}}));
  const v1::Limits& limits = info.limits();
  out.push_back(
      gauge("tesserad_limit", "What the daemon's options allow, in the unit of their name; 0: no limit.")
          .add(limits.max_sessions(), {{"option", "max-sessions"}})
          .add(limits.max_atlas_mtexels(), {{"option", "max-atlas-mtexels"}})
          .add(limits.max_scene_mib(), {{"option", "max-scene-mib"}})
          .add(limits.max_watchers(), {{"option", "max-watchers"}}));
  // These two have the names that every Prometheus client gives them.
  out.push_back(gauge("process_start_time_seconds", "Start of the process since the epoch.").add(start));
  out.push_back(gauge("process_resident_memory_bytes", "Resident memory.").add(resident_bytes()));
}

Metrics::Metrics(const v1::ServerInfo& info) : impl_(std::make_unique<Impl>(info)) {}
Metrics::~Metrics() = default;

void Metrics::on_rendered(const FrameStats& frame) {
  impl_->visibility.Observe(frame.times.visibility_ms / 1000);
  impl_->layout.Observe((frame.times.density_ms + frame.times.layout_ms) / 1000);
  impl_->shading.Observe(frame.times.shading_ms / 1000);
  impl_->encode.Observe(frame.times.encode_ms / 1000);
}

std::string Metrics::text(const StreamServer& streams, const SceneLibrary& scenes,
                          const ControlService& control) const {
  const StreamServerStats stats = streams.stats();
  std::vector<MetricFamily> families = impl_->registry.Collect();
  impl_->add_server(families);
  add_streams(stats, families);
  add_each_session(stats, families);
  add_refusals(stats, control.refusals(), families);
  add_scenes(scenes.list(), families);
  return prometheus::TextSerializer().Serialize(families);
}

}  // namespace tessera::server
