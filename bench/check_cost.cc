// What it costs to hold a stored scene against its checksum, as a share of reading it.
//
//     build/release/bench/check_cost FILE...
//
// A row for each file: megabytes; milliseconds to read it as a scene, what the check of what is read adds to that, and
// their ratio; milliseconds of a check alone, as before a download. Medians of 31 rounds, the three in turn; the files
// are in the system's cache, where the check shows most.
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <span>
#include <vector>

#include "bench/measure.h"
#include "engine/core/parallel.h"
#include "engine/io/scene_file.h"
#include "server/scenes/disk/digest.h"

int main(int argc, char** argv) {
  constexpr int rounds = 31;
  engine::WorkArena arena(0, engine::Priority::normal);
  std::printf(
      "| file | MB | read, ms | check adds, ms | share | check alone, ms |\n| --- | --- | --- | --- | --- | --- |\n");
  for (int i = 1; i < argc; ++i) {
    std::vector<double> reading, adding, checking;
    const auto digest = server::scenes::digest_of_file(argv[i]);
    if (!digest) return std::fprintf(stderr, "%s: %s\n", argv[i], digest.error().message.c_str()), 1;
    for (int round = 0; round < rounds; ++round) {
      const auto read = [&](const engine::io::ReadOptions& options) {
        bool is_scene = false;
        arena.run([&] { is_scene = engine::io::read_scene(argv[i], options).has_value(); });
        return is_scene;
      };
      auto start = bench::Clock::now();
      if (!read({})) return std::fprintf(stderr, "%s: no scene\n", argv[i]), 1;
      reading.push_back(bench::seconds_since(start));
      // The time of the check itself, in the midst of reading: the difference of two readings is mostly noise.
      double spent = 0;
      server::scenes::RunningDigest seen;
      engine::io::ReadOptions watched;
      watched.witness = [&](std::uint64_t offset, std::span<const std::byte> bytes) {
        const auto begin = bench::Clock::now();
        seen.see(offset, bytes);
        spent += bench::seconds_since(begin);
      };
      (void)read(watched);
      start = bench::Clock::now();
      if (!seen.check(argv[i], *digest, argv[i])) return 1;
      adding.push_back(spent + bench::seconds_since(start));
      start = bench::Clock::now();
      if (!server::scenes::check_digest(argv[i], *digest, argv[i])) return 1;
      checking.push_back(bench::seconds_since(start));
    }
    const double read_ms = 1e3 * bench::median(reading), add_ms = 1e3 * bench::median(adding);
    std::printf("| %s | %.1f | %.1f | %.2f | %.1f %% | %.2f |\n", std::filesystem::path(argv[i]).filename().c_str(),
                double(std::filesystem::file_size(argv[i])) / 1e6, read_ms, add_ms, 100 * add_ms / read_ms,
                1e3 * bench::median(checking));
  }
}
