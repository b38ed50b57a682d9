// The kinds of stores that a program of tests is about: those of sqlite_kind.cc or postgres_kind.cc, whichever it has.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "engine/jobs/store.h"

namespace engine::jobs {

/// How a test's store is opened.
struct StoreSetup {
  std::int64_t used_numbers = 0;
  int max_deaths = 3;
  bool own_clock = false;  ///< Its time is what set_time() says.
  bool visits = false;     ///< Somebody else than the service opens it.
};

/// Where the store of one test is, whoever has it open.
class StorePlace {
 public:
  virtual ~StorePlace() = default;
  /// As a service does that has it to itself.
  virtual Result<std::unique_ptr<Store>> open(const StoreSetup& setup) = 0;
  virtual void set_time(Time now) = 0;
};

struct StoreKind {
  std::string name;
  /// Of a new store.
  ///   folder  for its files, if it has any
  std::unique_ptr<StorePlace> (*make_place)(const std::filesystem::path& folder);
};
inline std::ostream& operator<<(std::ostream& out, const StoreKind& kind) { return out << kind.name; }

/// Nothing where this machine has none.
std::vector<StoreKind> store_kinds();

}  // namespace engine::jobs
