#include "server/scenes/disk/bounded_cache.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <new>
#include <optional>

namespace server::scenes {
namespace {

using engine::ErrorCode;
using engine::fail;
using engine::propagate;

std::string in_mib(std::uint64_t bytes) { return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB"; }

/// The result of `make`; an exception becomes an error: other threads wait for the outcome.
Result<BoundedCache::CachedObject> call_guarded(const std::function<Result<BoundedCache::CachedObject>()>& make) {
  try {
    return make();
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "it does not fit into the memory of this machine");
  } catch (const std::exception&) {
    return fail(ErrorCode::internal, "it could not be loaded, for a reason that nobody foresaw; please report this");
  }
}

}  // namespace

BoundedCache::Reservation::~Reservation() {
  if (bytes_ > 0) cache_->give_back(bytes_);
}

void BoundedCache::give_back(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  used_ -= bytes;
}

void BoundedCache::drop_forgotten() {
  std::erase_if(forgotten_, [&](const ForgottenObject& entry) {
    if (!entry.object.expired()) return false;
    used_ -= entry.bytes;
    return true;
  });
}

Result<void> BoundedCache::take(std::uint64_t bytes, Garbage& garbage) {
  drop_forgotten();
  // One reference is the cache's own. Nobody can begin to hold the object while the lock is held.
  const auto is_idle = [](const Entry& entry) { return entry.object.use_count() == 1; };
  if (when_full_ == WhenFull::refuse) {
    if (bytes > budget_)
      return fail(ErrorCode::too_large, "this needs " + in_mib(bytes) + " of " + limit_ + ", which is " +
                                            in_mib(budget_) + ": raise the limit");
    std::uint64_t in_use = used_;
    for (const auto& [name, entry] : entries_) in_use -= is_idle(entry) ? entry.bytes : 0;
    if (in_use > budget_ - bytes)
      return fail(ErrorCode::busy, "this needs " + in_mib(bytes) + " of " + limit_ + ", of which " + in_mib(in_use) +
                                       " of " + in_mib(budget_) + " are in use: try again later, or raise the limit");
  }
  while (used_ + bytes > budget_) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (!is_idle(entry->second)) continue;
      const auto rank = [](const Entry& e) { return std::pair(!e.can_be_made_again, e.last_use); };
      if (oldest == entries_.end() || rank(entry->second) < rank(oldest->second)) oldest = entry;
    }
    if (oldest == entries_.end()) break;
    used_ -= oldest->second.bytes;
    garbage.push_back(std::move(oldest->second.object));
    entries_.erase(oldest);
  }
  used_ += bytes;
  return {};
}

BoundedCache::Object BoundedCache::find_any(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(name);
  if (entry == entries_.end()) return nullptr;
  entry->second.last_use = ++clock_;
  return entry->second.object;
}

Result<BoundedCache::Object> BoundedCache::get_any(const std::string& name, std::uint64_t bytes,
                                                   const std::function<Result<CachedObject>()>& make) {
  Garbage garbage;
  std::promise<Result<Object>> promise;
  std::optional<std::shared_future<Result<Object>>> others;
  std::uint64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    if (const auto entry = entries_.find(name); entry != entries_.end()) {
      entry->second.last_use = ++clock_;
      return entry->second.object;
    }
    if (const auto build = in_progress_.find(name); build != in_progress_.end()) {
      others = build->second.result;
    } else {
      if (auto taken = take(bytes, garbage); !taken) return propagate(taken);
      number = ++clock_;
      in_progress_[name] = {promise.get_future().share(), number};
    }
  }
  garbage.clear();
  if (others) return others->get();

  Result<CachedObject> made = call_guarded(make);
  Result<Object> object = made ? Result<Object>(made->object) : Result<Object>(propagate(made));
  {
    const std::lock_guard lock(mutex_);
    const auto build = in_progress_.find(name);
    // Else the name was forgotten meanwhile.
    const bool wanted = build != in_progress_.end() && build->second.number == number;
    if (wanted) in_progress_.erase(build);
    used_ -= bytes;
    if (made) {
      used_ += made->bytes;
      if (wanted)
        entries_[name] = {*object, made->bytes, ++clock_, made->can_be_made_again};
      else
        forgotten_.push_back({*object, made->bytes});
    }
  }
  promise.set_value(object);
  return object;
}

void BoundedCache::put(const std::string& name, CachedObject object, Reservation reservation) {
  const std::lock_guard lock(mutex_);
  if (entries_.contains(name) || in_progress_.contains(name)) return;  // and the reservation ends after the lock
  entries_[name] = {std::move(object.object), object.bytes, ++clock_, object.can_be_made_again};
  used_ += object.bytes;
  used_ -= std::exchange(reservation.bytes_, 0);
}

Result<BoundedCache::Reservation> BoundedCache::reserve(std::uint64_t bytes) {
  Garbage garbage;
  {
    const std::lock_guard lock(mutex_);
    if (auto taken = take(bytes, garbage); !taken) return propagate(taken);
  }
  return Reservation(*this, bytes);
}

void BoundedCache::forget(const std::string& prefix) {
  Garbage garbage;
  const std::lock_guard lock(mutex_);
  for (auto entry = entries_.lower_bound(prefix); entry != entries_.end() && entry->first.starts_with(prefix);) {
    forgotten_.push_back({entry->second.object, entry->second.bytes});
    garbage.push_back(std::move(entry->second.object));
    entry = entries_.erase(entry);
  }
  for (auto build = in_progress_.lower_bound(prefix); build != in_progress_.end() && build->first.starts_with(prefix);)
    build = in_progress_.erase(build);
}

std::uint64_t BoundedCache::used() {
  const std::lock_guard lock(mutex_);
  drop_forgotten();
  return used_;
}

std::uint64_t BoundedCache::used_by(const std::string& prefix) {
  const std::lock_guard lock(mutex_);
  std::uint64_t sum = 0;
  for (auto entry = entries_.lower_bound(prefix); entry != entries_.end() && entry->first.starts_with(prefix); ++entry)
    sum += entry->second.bytes;
  return sum;
}

}  // namespace server::scenes
