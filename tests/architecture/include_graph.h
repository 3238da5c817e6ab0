// Which file includes which, and which room may use which, read from the sources themselves.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace tessera::architecture {

// Path relative to the source tree → the paths that it includes, as written.
using IncludeGraph = std::map<std::string, std::vector<std::string>>;
// Room → rooms that it may use besides itself.
using Rules = std::map<std::string, std::set<std::string>>;

// The #include lines of C++ and GLSL text.
std::vector<std::string> includes_of(const std::string& text);
// The TESSERA_MAY_USE_ lines of cmake/Rooms.cmake.
Rules parse_rules(const std::string& rooms_cmake);
// All C++ and GLSL files of the rooms.
IncludeGraph read_rooms(const std::filesystem::path& source_tree, const Rules& rules);
std::string read_text(const std::filesystem::path& file);

// The room of a path, the innermost if one lies in another; empty if it is none's.
std::string room_of(const std::string& path, const Rules& rules);
// One line for each include of a room that the including room may not use, or by a path with "..".
std::vector<std::string> forbidden_uses(const IncludeGraph& graph, const Rules& rules);
// What the files that start with one of `prefixes` include, themselves or through the rooms' headers.
std::set<std::string> reachable(const IncludeGraph& graph, const std::vector<std::string>& prefixes);

}  // namespace tessera::architecture
