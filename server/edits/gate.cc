#include "server/edits/gate.h"

namespace server::edits {

Gate::Hold Gate::share(const std::string& name) {
  std::unique_lock lock(mutex_);
  // Looked up anew each time: whoever leaves last takes the entry away.
  changed_.wait(lock, [&] { return !uses_[name].owned && uses_[name].waiting_owners == 0; });
  ++uses_[name].sharers;
  return Hold(*this, name, false);
}

Gate::Hold Gate::own(const std::string& name) {
  std::unique_lock lock(mutex_);
  Use& use = uses_[name];
  ++use.waiting_owners;
  changed_.wait(lock, [&] { return !use.owned && use.sharers == 0; });
  --use.waiting_owners;
  use.owned = true;
  return Hold(*this, name, true);
}

void Gate::release(const std::string& name, bool owns) {
  {
    const std::lock_guard lock(mutex_);
    Use& use = uses_[name];
    if (owns) {
      use.owned = false;
    } else {
      --use.sharers;
    }
    if (!use.owned && use.sharers == 0 && use.waiting_owners == 0) uses_.erase(name);
  }
  changed_.notify_all();
}

}  // namespace server::edits
