#include "server/edits/machine_memory.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/support/data.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t no_limit = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint64_t gib = std::uint64_t{1} << 30;

/// The files of a machine with 8 GiB.
struct Machine {
  Machine() { write("proc/meminfo", "MemTotal:        8388608 kB\nMemFree:          123456 kB\n"); }
  void write(const std::string& file, const std::string& text) const {
    fs::create_directories((root.path() / file).parent_path());
    support::write_file(root.path() / file, text);
  }
  [[nodiscard]] std::uint64_t memory(std::uint64_t address_space = no_limit) const {
    return memory_of_machine(root.path(), address_space);
  }
  support::TempDir root;
};

TEST(MachineMemory, IsWhatIsInstalledWhereNothingLimitsIt) {
  const Machine machine;
  EXPECT_EQ(machine.memory(), 8 * gib);
  machine.write("proc/self/cgroup", "0::/system.slice/splatdrag.service\n");
  machine.write("sys/fs/cgroup/system.slice/splatdrag.service/memory.max", "max\n");
  EXPECT_EQ(machine.memory(), 8 * gib);
}

TEST(MachineMemory, IsTheLeastLimitOfTheGroupsOfVersion2) {
  const Machine machine;
  machine.write("proc/self/cgroup", "0::/a.slice/b.service\n");
  machine.write("sys/fs/cgroup/a.slice/b.service/memory.max", "3221225472\n");
  EXPECT_EQ(machine.memory(), 3 * gib);
  machine.write("sys/fs/cgroup/a.slice/memory.max", "2147483648\n");
  EXPECT_EQ(machine.memory(), 2 * gib);
}

TEST(MachineMemory, IsTheLimitOfTheGroupOfVersion1) {
  const Machine machine;
  machine.write("proc/self/cgroup", "5:cpu,cpuacct:/x\n4:hugetlb,memory:/docker/abc\n0::/ignored\n");
  machine.write("sys/fs/cgroup/memory/docker/abc/memory.limit_in_bytes", "1073741824\n");
  machine.write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");  // its way to say: none
  EXPECT_EQ(machine.memory(), gib);
}

TEST(MachineMemory, AContainerThatSeesOnlyItsOwnGroupFindsItsLimitOutermost) {
  const Machine machine;
  machine.write("proc/self/cgroup", "4:memory:/docker/not/to/be/seen\n");
  machine.write("sys/fs/cgroup/memory/memory.limit_in_bytes", "1073741824\n");
  EXPECT_EQ(machine.memory(), gib);
}

TEST(MachineMemory, IsNoMoreThanTheAddressSpace) {
  const Machine machine;
  EXPECT_EQ(machine.memory(gib), gib);
  EXPECT_EQ(machine.memory(16 * gib), 8 * gib);
}

TEST(MachineMemory, IsNothingWhereNobodySays) {
  const support::TempDir empty;
  EXPECT_EQ(memory_of_machine(empty.path(), no_limit), 0u);
  const Machine machine;
  machine.write("proc/meminfo", "MemTotal: plenty\n");
  machine.write("proc/self/cgroup", "nonsense\n0:\n::\n\n");
  EXPECT_EQ(machine.memory(), 0u);
}

TEST(MachineMemory, OfThisMachineIsKnown) { EXPECT_GT(memory_of_machine(), std::uint64_t{64} << 20); }

}  // namespace
}  // namespace server::edits
