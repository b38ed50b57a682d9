// Whether to go on, asked within the calls of networks.
#pragma once

#include <functional>

#include "engine/core/result.h"
#include "engine/correct/repainter.h"
#include "engine/diffusion/guard.h"

namespace engine::diffusion {

/// An Advance that is asked before each block of a network, too: a call of one takes up to half a minute. Within a call
/// it is told what it was told before. One thread at a time may use an object.
class Going {
 public:
  /// advance  may be empty: it always goes on. Outlives this
  explicit Going(const correct::Advance& advance) : advance_(advance) {}

  /// So much is done, 0 to 1.
  [[nodiscard]] Result<void> at(double part) {
    part_ = part;
    return advance_ ? advance_(part) : Result<void>{};
  }
  /// For Model::before_block. Refers to this.
  [[nodiscard]] std::function<void()> asked() {
    return [this] {
      if (auto going = at(part_); !going) throw Ended(going.error());
    };
  }

 private:
  const correct::Advance& advance_;
  double part_ = 0;
};

}  // namespace engine::diffusion
