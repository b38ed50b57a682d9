#include "server/edits/named_locks.h"

namespace server::edits {

NamedLocks::Lock NamedLocks::lock_shared(const std::string& name) {
  std::unique_lock guard(mutex_);
  // Looked up anew each time: whoever leaves last takes the entry away.
  changed_.wait(guard, [&] { return !entries_[name].exclusive && entries_[name].waiting_exclusive == 0; });
  ++entries_[name].shared;
  return Lock(*this, name, false);
}

NamedLocks::Lock NamedLocks::lock(const std::string& name) {
  std::unique_lock guard(mutex_);
  Entry& entry = entries_[name];
  ++entry.waiting_exclusive;
  changed_.wait(guard, [&] { return !entry.exclusive && entry.shared == 0; });
  --entry.waiting_exclusive;
  entry.exclusive = true;
  return Lock(*this, name, true);
}

void NamedLocks::release(const std::string& name, bool exclusive) {
  {
    const std::lock_guard guard(mutex_);
    Entry& entry = entries_[name];
    if (exclusive) {
      entry.exclusive = false;
    } else {
      --entry.shared;
    }
    if (!entry.exclusive && entry.shared == 0 && entry.waiting_exclusive == 0) entries_.erase(name);
  }
  changed_.notify_all();
}

}  // namespace server::edits
