// Work on the parts of one picture, by several threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace tessera::codec {

// Threads for `parts` equal parts: no more than the machine has cores, nor than help.
inline size_t workers_for(size_t parts) {
  constexpr size_t kMost = 8;
  return std::clamp<size_t>(std::min<size_t>(parts, std::thread::hardware_concurrency()), 1, kMost);
}

// Calls work(worker, part) once for each part below `parts`, `worker` being below `workers`; no two calls at
// a time have the same worker. The caller is one of them; returns when all is done.
template <class Work>
void for_each_part(size_t parts, size_t workers, const Work& work) {
  std::atomic<size_t> next = 0;
  const auto run = [&](size_t worker) {
    for (size_t part = next++; part < parts; part = next++) work(worker, part);
  };
  std::vector<std::jthread> helpers;
  for (size_t worker = 1; worker < std::min(workers, parts); ++worker)
    helpers.emplace_back([&run, worker] { run(worker); });
  run(0);
}

}  // namespace tessera::codec
