// Job records in one SQLite file, for one process.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// Where the file is, and how it is opened.
struct SqliteOptions {
  std::filesystem::path folder;                  ///< The file is "jobs.db" in it; made if absent.
  std::chrono::milliseconds busy_timeout{2000};  ///< Longest wait for a process that is just ending.
  std::int64_t used_numbers = 0;                 ///< Ids up to this one are known elsewhere and not given away, even if
                                                 ///< the file is new because an old one was lost.
  bool must_exist = false;                       ///< There have been jobs: a file that is absent or empty was lost.
  int max_deaths =
      3;  ///< A job whose process has died so often in a row at the same place has failed; 0: never. A choice.
  std::string holder = {};  ///< How this process is called in the claims that it makes.
  /// Somebody comes to look, or to change a record, and claims nothing: claims that are there stay, whoever has them.
  bool visits = false;
  std::function<Time()> now = [] {
    return std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
  };
};

/// The embedded store: write-ahead log, synchronous=FULL. The process holds the file alone until it ends, however it
/// ends; so whoever opens it knows that no worker is left, and open() ends every claim (Event::abandon).
class SqliteStore final : public Store {
 public:
  ///   errors  unavailable: another process holds the file, or it cannot be opened; corrupt_data: it is damaged, lost
  ///           or no job store; unsupported: a newer version wrote it; no_space. `where` is the file.
  [[nodiscard]] static Result<std::unique_ptr<SqliteStore>> open(const SqliteOptions& options);
  ~SqliteStore() override;

  using Store::requeue;
  using Store::submit;
  [[nodiscard]] Result<Submission> submit(const NewJob& job, std::size_t max_queued, const Witness& witness) override;
  [[nodiscard]] Result<void> check_room(std::size_t max_queued) override;
  [[nodiscard]] Result<void> check_quota(const NewJob& job) override;
  [[nodiscard]] Result<Usage> usage(const std::string& requester) override;
  [[nodiscard]] Result<Job> requeue(const std::string& id, int finished_intervals, const Witness& witness) override;
  [[nodiscard]] Result<Time> now() override;
  [[nodiscard]] Result<void> restore(const Job& job) override;
  [[nodiscard]] Result<Job> find(const std::string& id) override;
  [[nodiscard]] Result<std::optional<Job>> find_key(const std::string& idempotency_key) override;
  [[nodiscard]] Result<std::vector<Job>> list(const Filter& filter) override;
  [[nodiscard]] Result<std::optional<Job>> claim() override;
  [[nodiscard]] std::optional<std::chrono::milliseconds> lease() const override { return std::nullopt; }
  [[nodiscard]] Result<JobState> renew(const std::string& id, std::int64_t claim) override;
  [[nodiscard]] Result<bool> should_make_way(const std::string& id, std::chrono::milliseconds left) override;
  [[nodiscard]] Result<Job> apply(const std::string& id, const Change& change) override;
  [[nodiscard]] Result<void> remove(const std::string& id) override;
  [[nodiscard]] Result<std::vector<std::string>> expire(const Retention& retention) override;
  void watch(std::function<void()>) override {}  // nobody else has the file

 private:
  struct Impl;
  explicit SqliteStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine::jobs
