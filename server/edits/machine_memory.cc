#include "server/edits/machine_memory.h"

#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

namespace server::edits {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t no_limit = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t kibibyte = 1024;

/// The number that a file begins with; no limit where it says "max", or is not there.
std::uint64_t limit_in(const fs::path& file) {
  std::ifstream in(file);
  std::uint64_t limit = 0;
  return in >> limit ? limit : no_limit;
}

/// The least limit of a group and those above it. A container often sees the names of groups that it does not see the
/// folders of: the limit is then that of the outermost folder, which is its own group.
std::uint64_t least_limit(const fs::path& hierarchy, fs::path group, const std::string& name) {
  std::uint64_t least = limit_in(hierarchy / name);
  for (group = group.relative_path(); !group.empty(); group = group.parent_path())
    least = std::min(least, limit_in(hierarchy / group / name));
  return least;
}

bool is_listed(std::string_view list, std::string_view wanted) {
  while (!list.empty()) {
    const std::string_view entry = list.substr(0, list.find(','));
    if (entry == wanted) return true;
    list.remove_prefix(std::min(entry.size() + 1, list.size()));
  }
  return false;
}

/// Lines of /proc/self/cgroup are number:controllers:group; version 2 has no controllers there.
std::uint64_t group_limit(const fs::path& root) {
  const fs::path mounted = root / "sys/fs/cgroup";
  std::ifstream groups(root / "proc/self/cgroup");
  std::uint64_t least = no_limit;
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1), group = line.substr(second + 1);
    if (controllers.empty()) least = std::min(least, least_limit(mounted, group, "memory.max"));
    if (is_listed(controllers, "memory"))
      least = std::min(least, least_limit(mounted / "memory", group, "memory.limit_in_bytes"));
  }
  return least;
}

std::uint64_t installed(const fs::path& root) {
  std::ifstream meminfo(root / "proc/meminfo");
  for (std::string word; meminfo >> word;)
    if (std::uint64_t kibibytes = 0; word == "MemTotal:") return meminfo >> kibibytes ? kibibytes * kibibyte : no_limit;
  return no_limit;
}

}  // namespace

std::uint64_t address_space_limit() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY ? std::uint64_t(limit.rlim_cur)
                                                                                : no_limit;
}

std::uint64_t memory_of_machine(const fs::path& root, std::uint64_t address_space) {
  const std::uint64_t memory = std::min({installed(root), group_limit(root), address_space});
  return memory == no_limit ? 0 : memory;
}

}  // namespace server::edits
