// Whether the service can work: what /readyz answers.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

#include "engine/core/result.h"

namespace server::service {

/// Safe to call from any thread.
class Readiness {
 public:
  using Trouble = std::function<std::optional<engine::Error>()>;

  /// data_dir        what is accepted goes there
  /// others          what else keeps the service from working, if anything does; outlives this
  /// min_free_bytes  with less on its disk the service can accept nothing. A choice: a few records of edits.
  Readiness(std::filesystem::path data_dir, Trouble others, std::uint64_t min_free_bytes = std::uint64_t{1} << 20)
      : data_dir_(std::move(data_dir)), others_(std::move(others)), min_free_bytes_(min_free_bytes) {}

  /// From now on the service is not ready: it ends.
  void end() noexcept { is_ending_ = true; }
  /// Nothing if it is ready. Names no folder of this machine.
  [[nodiscard]] std::optional<engine::Error> trouble() const;

 private:
  const std::filesystem::path data_dir_;
  const Trouble others_;
  const std::uint64_t min_free_bytes_;
  std::atomic<bool> is_ending_ = false;
};

}  // namespace server::service
