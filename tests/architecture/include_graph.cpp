#include "include_graph.h"

#include <fstream>
#include <iterator>
#include <sstream>

namespace tessera::architecture {

std::string read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> includes_of(const std::string& text) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream in(line);
    char hash = 0, open = 0;
    std::string path;
    // "#", "include" and the path may have blanks between them.
    if (!(in >> hash) || hash != '#' || !(in >> std::ws)) continue;
    std::string word(7, ' ');
    if (!in.read(word.data(), 7) || word != "include" || !(in >> open)) continue;
    if (open != '<' && open != '"') continue;
    if (std::getline(in, path, open == '<' ? '>' : '"')) found.push_back(path);
  }
  return found;
}

Rules parse_rules(const std::string& rooms_cmake) {
  const std::string set = "set(TESSERA_", rooms = "ROOMS", may_use = "MAY_USE_";
  Rules rules;
  std::set<std::string> all;
  std::istringstream lines(rooms_cmake);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(set)) continue;
    std::istringstream words(line.substr(set.size(), line.find(')') - set.size()));
    std::string key;
    words >> key;
    std::set<std::string> names;
    for (std::string word; words >> word;) {
      if (word == "${TESSERA_ROOMS}") {
        names.insert(all.begin(), all.end());
      } else if (word != "\"\"") {
        names.insert(word);
      }
    }
    if (key == rooms) all = names;
    if (key.starts_with(may_use)) rules[key.substr(may_use.size())] = names;
  }
  return rules;
}

IncludeGraph read_rooms(const std::filesystem::path& source_tree, const Rules& rules) {
  static const std::set<std::string> extensions{".h",    ".cpp",  ".glsl", ".comp",
                                                ".vert", ".frag", ".tesc", ".tese"};
  IncludeGraph graph;
  for (const auto& [room, used] : rules) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(source_tree / room)) {
      if (!entry.is_regular_file() || !extensions.contains(entry.path().extension().string())) continue;
      const std::string path = entry.path().lexically_relative(source_tree).generic_string();
      graph[path] = includes_of(read_text(entry.path()));
    }
  }
  return graph;
}

std::string room_of(const std::string& path, const Rules& rules) {
  for (size_t end = path.rfind('/'); end != std::string::npos && end > 0; end = path.rfind('/', end - 1)) {
    if (const std::string folder = path.substr(0, end); rules.contains(folder)) return folder;
  }
  return "";
}

std::vector<std::string> forbidden_uses(const IncludeGraph& graph, const Rules& rules) {
  std::vector<std::string> found;
  for (const auto& [file, includes] : graph) {
    const std::string room = room_of(file, rules);
    for (const std::string& include : includes) {
      const std::string used = room_of(include, rules);
      const bool allowed = used.empty() || used == room || rules.at(room).contains(used);
      if (!allowed || include.find("..") != std::string::npos) found.push_back(file + " includes " + include);
    }
  }
  return found;
}

std::set<std::string> reachable(const IncludeGraph& graph, const std::vector<std::string>& prefixes) {
  std::vector<std::string> open;
  for (const auto& [file, includes] : graph) {
    for (const std::string& prefix : prefixes) {
      if (file.starts_with(prefix)) open.push_back(file);
    }
  }
  std::set<std::string> seen;
  while (!open.empty()) {
    const auto node = graph.find(open.back());
    open.pop_back();
    if (node == graph.end()) continue;
    for (const std::string& include : node->second) {
      if (seen.insert(include).second) open.push_back(include);
    }
  }
  return seen;
}

}  // namespace tessera::architecture
