#include "engine/jobs/sqlite_store.h"
#include "tests/engine/jobs/store_kind.h"

namespace engine::jobs {
namespace {

class SqlitePlace final : public StorePlace {
 public:
  explicit SqlitePlace(std::filesystem::path folder) : folder_(std::move(folder)) {}
  Result<std::unique_ptr<Store>> open(const StoreSetup& setup) override {
    SqliteOptions options{.folder = folder_,
                          .busy_timeout = std::chrono::milliseconds(20),
                          .used_numbers = setup.used_numbers,
                          .max_deaths = setup.max_deaths,
                          .holder = "here:1",
                          .visits = setup.visits};
    if (setup.own_clock) options.now = [this] { return now_; };
    auto store = SqliteStore::open(options);
    if (!store) return propagate(store);
    return std::move(*store);
  }
  void set_time(Time now) override { now_ = now; }

 private:
  std::filesystem::path folder_;
  Time now_{};
};

}  // namespace

std::vector<StoreKind> store_kinds() {
  return {{"Sqlite", [](const std::filesystem::path& folder) -> std::unique_ptr<StorePlace> {
             return std::make_unique<SqlitePlace>(folder);
           }}};
}

}  // namespace engine::jobs
