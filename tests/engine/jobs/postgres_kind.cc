#include "engine/jobs/postgres_store.h"
#include "tests/engine/jobs/postgres_support.h"
#include "tests/engine/jobs/store_kind.h"

namespace engine::jobs {
namespace {

class PostgresPlace final : public StorePlace {
 public:
  Result<std::unique_ptr<Store>> open(const StoreSetup& setup) override {
    PostgresOptions options = database_.options();
    options.alone = true;
    options.holder = "here:1";
    options.visits = setup.visits;
    options.used_numbers = setup.used_numbers;
    options.max_deaths = setup.max_deaths;
    options.lease = std::chrono::hours(24 * 365);  // what ends with a lease, the tests of this store alone are about
    if (setup.own_clock) options.now = database_.own_clock();
    auto store = PostgresStore::open(options);
    if (!store) return propagate(store);
    return std::move(*store);
  }
  void set_time(Time now) override { database_.set_time(now); }

 private:
  TestDatabase database_;
};

}  // namespace

std::vector<StoreKind> store_kinds() {
  if (!support::PostgresServer::is_installed()) return {};
  return {{"Postgres", [](const std::filesystem::path&) -> std::unique_ptr<StorePlace> {
             return std::make_unique<PostgresPlace>();
           }}};
}

}  // namespace engine::jobs
