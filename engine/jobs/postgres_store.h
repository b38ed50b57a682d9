// Job records in a PostgreSQL database, which many processes may share: docs/postgresql.md tells whoever sets it up,
// docs/adr/0032-claims-that-end.md why it is as it is.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// Where the database is, and how it is opened.
struct PostgresOptions {
  std::string address;  ///< "postgresql://user@host:port/database", as libpq takes it.
  /// Whose jobs they are, in any words that are always the same. Whoever opens the database first leaves them there;
  /// nobody who says otherwise can open it.
  std::string owner = {};
  std::string owner_for_people = {};  ///< Where that owner is found: for those whom it keeps out.
  /// Nobody else has the store open meanwhile: then whoever is left as the holder of a job is no more, as with
  /// SqliteStore, and open() ends every claim (Event::abandon).
  bool alone = false;
  std::string holder = {};  ///< How this process is called in the claims that it makes.
  /// Somebody comes to look, or to change a record, and claims nothing: nobody is kept out, nor are they by whoever is
  /// alone; tables are not made, and not brought up to date.
  bool visits = false;
  std::chrono::milliseconds lease{30'000};       ///< How long a claim lasts that is not renewed. A choice.
  std::chrono::milliseconds busy_timeout{2000};  ///< Longest wait for a process that is just ending.
  std::int64_t used_numbers = 0;                 ///< As of SqliteOptions.
  bool must_exist = false;                       ///< There have been jobs: a database without any has lost them.
  int max_deaths = 3;                            ///< As of SqliteOptions; a claim that runs out is a death.
  /// The time, in SQL, in milliseconds since 1970: the server's, so that no host's clock matters.
  std::string now = "floor(extract(epoch FROM now()) * 1000)::bigint";
};

/// The shared store. A claim that has not been renewed for its lease passes to whoever claims next, with another
/// number; nothing that carries the old number is written any more. Where the connection is lost, a function tries once
/// more over a new one, and tells what became of a change whose answer was lost on the way; it fails with `unavailable`
/// if there is no server, and works again once there is.
class PostgresStore final : public Store {
 public:
  /// Makes the tables, or those of an older version into ours; several processes may do so at once.
  ///   errors  invalid_argument: the address is none; unavailable: the server cannot be reached or lets nobody in of
  ///           this name, or somebody has the store open and one of the two is to be `alone`; conflict: the jobs are
  ///           another owner's; corrupt_data: the tables are not ours, or lost; unsupported: a newer version wrote
  ///           them; not_found: somebody visits, and there are no tables. `where` is the address without its password
  [[nodiscard]] static Result<std::unique_ptr<PostgresStore>> open(const PostgresOptions& options);
  /// Puts the tables aside, under a name that nothing has, so that open() makes new ones.
  ///   returns  that name; empty: there was nothing
  ///   errors   those of open(); unavailable: somebody has the store open
  [[nodiscard]] static Result<std::string> move_away(const PostgresOptions& options);
  ~PostgresStore() override;

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
  [[nodiscard]] std::optional<std::chrono::milliseconds> lease() const override;
  [[nodiscard]] Result<JobState> renew(const std::string& id, std::int64_t claim) override;
  [[nodiscard]] Result<bool> should_make_way(const std::string& id, std::chrono::milliseconds left) override;
  [[nodiscard]] Result<Job> apply(const std::string& id, const Change& change) override;
  [[nodiscard]] Result<void> remove(const std::string& id) override;
  [[nodiscard]] Result<std::vector<std::string>> expire(const Retention& retention) override;
  void watch(std::function<void()> news) override;

 private:
  struct Impl;
  explicit PostgresStore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine::jobs
