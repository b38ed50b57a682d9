// How many claims and heartbeats a second one PostgreSQL bears: rows for the table in docs/postgresql.md. Starts a
// server of its own that waits for its disk, with the settings of the tests' one (defaults, but little memory).
//
//   claim_rate [--jobs N] [--without-disk]
//
// Claimers are threads, each with a store of its own: to the server that is the same as so many processes.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "engine/jobs/postgres_store.h"
#include "tests/support/postgres_server.h"

namespace {

using engine::jobs::PostgresOptions;
using engine::jobs::PostgresStore;
using Clock = std::chrono::steady_clock;

template <class T>
T value(engine::Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

/// Seconds until all have done `body`, each with its own store.
double seconds_of(int count, const PostgresOptions& options, const std::function<void(PostgresStore&)>& body) {
  std::vector<std::unique_ptr<PostgresStore>> stores;
  for (int i = 0; i < count; ++i) stores.push_back(value(PostgresStore::open(options)));
  std::atomic<bool> failed = false;
  std::vector<std::thread> threads;
  const auto start = Clock::now();
  for (const auto& store : stores)
    threads.emplace_back([&] {
      try {
        body(*store);
      } catch (const std::exception& e) {
        std::fprintf(stderr, "%s\n", e.what());
        failed = true;
      }
    });
  for (std::thread& thread : threads) thread.join();
  if (failed) throw std::runtime_error("a claimer failed");
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void measure(support::PostgresServer& server, int claimers, int jobs) {
  const std::string database = server.new_database();
  const PostgresOptions options{.address = server.address(database)};
  (void)value(PostgresStore::open(options));
  server.run(database,
             "INSERT INTO splatdrag.jobs (number, lane, payload, expected, turn, state, created) SELECT i, "
             "convert_to('s' || i, 'UTF8'), convert_to(repeat('x', 500), 'UTF8'), 1000, i, 'queued', i "
             "FROM generate_series(1, " +
                 std::to_string(jobs) + ") AS i");
  std::atomic<int> claimed = 0;
  const double claiming = seconds_of(claimers, options, [&](PostgresStore& store) {
    while (value(store.claim())) ++claimed;
  });
  if (claimed != jobs) throw std::runtime_error("a job was given away twice, or to nobody");
  const int beats = std::max(1, jobs / claimers);
  std::atomic<int> next = 0;
  const double beating = seconds_of(claimers, options, [&](PostgresStore& store) {
    const std::string id = engine::jobs::id_of(++next);
    for (int i = 0; i < beats; ++i) (void)value(store.renew(id, 1));
  });
  std::printf("| %d | %.0f | %.0f |\n", claimers, jobs / claiming, claimers * beats / beating);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    int jobs = 20'000;
    support::PostgresServer::Options options{.waits_for_disk = true};
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      if (arguments[i] == "--without-disk") options.waits_for_disk = false;
      if (arguments[i] == "--jobs" && i + 1 < arguments.size()) jobs = std::stoi(arguments[i + 1]);
    }
    support::PostgresServer server(options);
    std::printf("| claimers | claims/s | heartbeats/s |\n| ---: | ---: | ---: |\n");
    for (const int claimers : {1, 4, 16, 40}) measure(server, claimers, jobs);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "error: %s\n", e.what());
    return 1;
  }
}
