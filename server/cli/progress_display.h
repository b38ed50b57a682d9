// Shows long work to the person who waits for it.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <ostream>
#include <string>

#include "engine/edit/edit.h"
#include "server/cli/terminal.h"

namespace server::cli {

/// On a terminal, one line that redraws itself; otherwise a line every few percent.
class ProgressDisplay {
 public:
  enum class Style { bar, lines };
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  ProgressDisplay(std::ostream& out, Style style, Clock clock = std::chrono::steady_clock::now);
  /// On the error stream, as suits it.
  explicit ProgressDisplay(const Terminal& terminal);
  /// Removes the bar, so that what follows starts on a fresh line.
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  /// Shows progress, 0 to 1, and the name of the work at hand.
  ///   seconds_left  nothing: guessed from how far it has come since it was first shown
  void show(double fraction, const std::string& doing, std::optional<double> seconds_left = std::nullopt);
  void show(const engine::edit::Progress& progress);

 private:
  [[nodiscard]] std::optional<double> guessed_seconds_left(double fraction) const;

  std::ostream& out_;
  Style style_;
  Clock clock_;
  std::chrono::steady_clock::time_point start_, drawn_;
  std::optional<double> first_fraction_;  ///< Of the first call of show(): a resumed edit does not begin at 0.
  int percent_ = -1;                      ///< Of the last call of show().
};

}  // namespace server::cli
