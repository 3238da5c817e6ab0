#include "base/frame_trace.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

namespace tessera {
namespace {

FrameRecord shown() {
  FrameRecord r{.session = 3, .frame = 8, .key_frame = true, .atlas_bytes = 100, .meta_bytes = 20};
  r.pose_sent = 1'000'000;
  r.server = {.pose_received = 52'000'000,
              .due = 53'000'000,
              .render_begin = 53'000'000,
              .render_end = 63'000'000,
              .sent = 63'000'000,
              .visibility = 4'000'000,
              .layout = 1'000'000,
              .shading = 3'000'000,
              .encode = 2'000'000};
  r.client = {.frame = 8,
              .atlas_first_packet = 14'000'000,
              .atlas_complete = 15'000'000,
              .atlas_decode_begin = 15'000'000,
              .atlas_decoded = 18'000'000,
              .meta_complete = 14'000'000,
              .meta_decode_begin = 14'000'000,
              .meta_decoded = 14'500'000,
              .draw_begin = 20'000'000,
              .displayed = 24'000'000,
              .clock_offset = 50'000'000,
              .clock_error = 100'000};
  return r;
}
FrameRecord lost() {
  FrameRecord r = shown();
  r.frame = r.client.frame = 9;
  r.client.atlas_decoded = r.client.draw_begin = r.client.displayed = 0;
  return r;
}

std::vector<std::vector<std::string>> parse(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string>& row = rows.emplace_back();
    std::istringstream cells(line + ',');  // getline gives no last empty cell
    for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
  }
  return rows;
}

TEST(FrameTrace, CsvHasACellForEveryColumnOfEveryFrame) {
  const FrameRecord records[] = {shown(), lost()};
  std::ostringstream out;
  write_csv(records, out);
  const auto rows = parse(out.str());
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].size(), rows[0].size());
  EXPECT_EQ(rows[2].size(), rows[0].size());
  const auto cell = [&](size_t row, const std::string& column) {
    const auto at = std::ranges::find(rows[0], column);
    return at == rows[0].end() ? "no such column" : rows[row][static_cast<size_t>(at - rows[0].begin())];
  };
  EXPECT_EQ(cell(1, "frame"), "8");
  EXPECT_EQ(cell(1, "displayed_ns"), "24000000");
  EXPECT_EQ(cell(1, "pose_uplink_ms"), "1");
  EXPECT_EQ(cell(1, "end_to_end_ms"), "23");
  EXPECT_EQ(cell(1, "sum_ms"), "23");
  EXPECT_EQ(cell(2, "displayed_ns"), "0");
  EXPECT_EQ(cell(2, "end_to_end_ms"), "");
}

// What a viewer of traces needs: spans with start and length in microseconds on one clock, in named tracks.
TEST(FrameTrace, SpansLieOnOneClock) {
  const FrameRecord records[] = {shown(), lost()};
  std::ostringstream out;
  write_chrome_trace(records, out);
  const auto trace = nlohmann::json::parse(out.str());
  std::map<std::pair<int, std::string>, std::pair<double, double>> spans;  // of frame 8
  std::set<int> named, used;
  int drawn = 0;
  for (const auto& event : trace["traceEvents"]) {
    EXPECT_EQ(event["pid"], 3);
    if (event["ph"] == "M") {
      if (event["name"] == "thread_name") named.insert(event["tid"].get<int>());
      continue;
    }
    ASSERT_EQ(event["ph"], "X");
    EXPECT_GE(event["ts"], 0);
    EXPECT_GE(event["dur"], 0);
    used.insert(event["tid"].get<int>());
    drawn += event["name"] == "draw";
    if (event["args"]["frame"] == 8)
      spans[{event["tid"], event["name"]}] = {event["ts"],
                                              event["ts"].get<double>() + event["dur"].get<double>()};
  }
  EXPECT_TRUE(std::ranges::includes(named, used));
  EXPECT_EQ(drawn, 1) << "the lost frame was not drawn";
  EXPECT_EQ((spans[{0, "pose"}]), (std::pair(0.0, 1000.0)));
  EXPECT_EQ((spans[{1, "frame 8"}]), (std::pair(2000.0, 12000.0)));
  EXPECT_EQ((spans[{1, "shading"}]), (std::pair(7000.0, 10000.0)));
  EXPECT_EQ((spans[{2, "atlas"}]), (std::pair(12000.0, 14000.0)));
  EXPECT_EQ((spans[{6, "draw"}]), (std::pair(19000.0, 23000.0)));
}

}  // namespace
}  // namespace tessera
