// A cache of objects that cost something to make and something to keep, within a budget of bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

/// What to do when what is in use leaves no room for something new.
enum class WhenFull {
  refuse,  ///< An error: it is memory that is being counted.
  exceed   ///< Keep it while it is in use: it is a convenience that is being counted.
};

/// Objects by name, within a budget. One that somebody holds stays; among the others, those least recently asked for go
/// first, and those that cannot be made again go last. Safe to call from any thread; nothing is made or destroyed under
/// its lock.
class BoundedCache {
 public:
  using Object = std::shared_ptr<const void>;
  struct CachedObject {
    Object object;
    std::uint64_t bytes = 0;  ///< What it takes; at most the `bytes` given to get().
    bool can_be_made_again = true;
  };

  /// budget  in bytes; `limit` is its name in messages: "the scene memory"
  BoundedCache(std::uint64_t budget, std::string limit, WhenFull when_full)
      : budget_(budget), limit_(std::move(limit)), when_full_(when_full) {}

  /// The object of that name, made by `make` if it is not here; several callers at once wait for one call of `make`.
  ///   bytes   most that it will take; room is made before the work begins
  ///   errors  too_large: it alone exceeds the budget, which the message names; busy: others use the memory;
  ///           those of `make`
  template <class T>
  [[nodiscard]] Result<std::shared_ptr<const T>> get(const std::string& name, std::uint64_t bytes,
                                                     const std::function<Result<CachedObject>()>& make) {
    auto object = get_any(name, bytes, make);
    if (!object) return tl::make_unexpected(object.error());
    return std::static_pointer_cast<const T>(*object);
  }
  /// The object of that name if it is here, else null.
  template <class T>
  [[nodiscard]] std::shared_ptr<const T> find(const std::string& name) {
    return std::static_pointer_cast<const T>(find_any(name));
  }

  /// Bytes of the budget that are set aside while this lives: for memory that a computation needs for a while.
  class Reservation {
   public:
    Reservation(BoundedCache& cache, std::uint64_t bytes) : cache_(&cache), bytes_(bytes) {}
    Reservation(Reservation&& other) noexcept : cache_(other.cache_), bytes_(std::exchange(other.bytes_, 0)) {}
    Reservation& operator=(Reservation&&) = delete;
    ~Reservation();

   private:
    friend class BoundedCache;
    BoundedCache* cache_;
    std::uint64_t bytes_;
  };
  ///   errors  too_large, busy: as get()
  [[nodiscard]] Result<Reservation> reserve(std::uint64_t bytes);
  /// Adds an object that was made under a reservation; from now on its own bytes count. An object of that name which is
  /// here already, or is being made, stays instead.
  void put(const std::string& name, CachedObject object, Reservation reservation);

  /// Objects whose names begin so are not found any more. Their bytes count for as long as somebody holds them.
  void forget(const std::string& prefix);

  [[nodiscard]] std::uint64_t used();                              ///< Bytes, reservations included.
  [[nodiscard]] std::uint64_t used_by(const std::string& prefix);  ///< Bytes of objects whose names begin so.
  [[nodiscard]] std::uint64_t budget() const { return budget_; }

 private:
  struct Entry {
    Object object;
    std::uint64_t bytes = 0;
    std::uint64_t last_use = 0;
    bool can_be_made_again = true;
  };
  struct Build {
    std::shared_future<Result<Object>> result;
    std::uint64_t number = 0;
  };
  using Garbage = std::vector<Object>;  ///< Destroyed after the lock is released.

  Result<Object> get_any(const std::string& name, std::uint64_t bytes,
                         const std::function<Result<CachedObject>()>& make);
  Object find_any(const std::string& name);
  /// Counts `bytes` as used, if need be by dropping what nobody holds; on an error nothing is dropped. Call this and
  /// drop_forgotten() under the lock.
  Result<void> take(std::uint64_t bytes, Garbage& garbage);
  void drop_forgotten();
  void give_back(std::uint64_t bytes);

  const std::uint64_t budget_;
  const std::string limit_;
  const WhenFull when_full_;
  std::mutex mutex_;
  std::map<std::string, Entry> entries_;
  std::map<std::string, Build> in_progress_;
  struct ForgottenObject {
    std::weak_ptr<const void> object;
    std::uint64_t bytes = 0;
  };
  std::vector<ForgottenObject> forgotten_;  ///< Forgotten, but perhaps still held by somebody: their bytes count.
  std::uint64_t used_ = 0, clock_ = 0;
};

}  // namespace server::scenes
