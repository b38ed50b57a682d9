// The rules of the house that a program can check: arrows between rooms, third-party libraries in their rooms, headers.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace house {

/// Folder of a room ("engine/render", "proto") and the folders of those it may include.
using Arrows = std::map<std::string, std::set<std::string>>;

/// Reads what CMake wrote: "engine/scene: engine_core", one room a line.
[[nodiscard]] Arrows parse_arrows(const std::string& text);

/// Rooms that lie on a circle of arrows, in order, the first one repeated at the end; empty if there is no circle.
[[nodiscard]] std::vector<std::string> find_circle(const Arrows& arrows);

/// What is wrong with one source file, a sentence each: "engine/mask/mask.cc:3: ...". What is neither a header (.h) nor
/// a source (.cc) is taken for a part of those that include it (.inc): it keeps the rules of a header, but needs no
/// `#pragma once`, since some are included more than once.
///   file  path from the project's root
[[nodiscard]] std::vector<std::string> violations(const Arrows& arrows, const std::string& file,
                                                  const std::string& source);

/// What is wrong with all of them: headers, sources, and every other file that one of these includes. An .inc that
/// nobody includes is wrong, too.
///   files  contents by path from the project's root
[[nodiscard]] std::vector<std::string> violations(const Arrows& arrows,
                                                  const std::map<std::string, std::string>& files);

/// What one file calls of <algorithm> without including it, a sentence for its first call: precompiled headers hide
/// that, and a build without them fails. Of an .inc nothing is asked: those that include it do.
///   file  path from the project's root
[[nodiscard]] std::vector<std::string> lacks_includes(const std::string& file, const std::string& source);

}  // namespace house
