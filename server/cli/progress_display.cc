#include "server/cli/progress_display.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace server::cli {
namespace {

using namespace std::chrono_literals;
using Seconds = std::chrono::duration<double>;

constexpr auto redraw_every = 100ms;  // faster than anyone reads, slow enough to cost nothing
constexpr int line_every = 5;         // percent
constexpr int bar_width = 28;         // characters

std::string time_left(double left) {
  const auto seconds = std::int64_t(std::ceil(left));
  if (seconds < 90) return "  about " + std::to_string(seconds) + " s left";
  return "  about " + std::to_string((seconds + 59) / 60) + " min left";
}

}  // namespace

ProgressDisplay::ProgressDisplay(std::ostream& out, Style style, Clock clock)
    : out_(out), style_(style), clock_(std::move(clock)), start_(clock_()), drawn_(start_ - redraw_every) {}

ProgressDisplay::ProgressDisplay(const Terminal& terminal)
    : ProgressDisplay(terminal.err, terminal.err_is_terminal ? Style::bar : Style::lines) {}

ProgressDisplay::~ProgressDisplay() {
  if (style_ == Style::bar && percent_ >= 0) out_ << "\r\x1b[K" << std::flush;
}

void ProgressDisplay::show(double fraction, const std::string& doing, std::optional<double> seconds_left) {
  const int percent = int(std::floor(100 * std::clamp(fraction, 0.0, 1.0)));
  if (!first_fraction_) first_fraction_ = fraction;
  if (!seconds_left) seconds_left = guessed_seconds_left(fraction);
  const auto line = [&] {
    const std::string left = seconds_left && fraction < 1 ? time_left(*seconds_left) : "";
    return std::to_string(percent) + " %  " + doing + left;
  };
  if (style_ == Style::bar) {
    if (clock_() - drawn_ < redraw_every && percent < 100) return;
    drawn_ = clock_();
    const int filled = bar_width * percent / 100;
    // Without wrapping (?7l): of a line that is wider than the terminal only the last part would be redrawn.
    out_ << "\r\x1b[K\x1b[?7l[" << std::string(std::size_t(filled), '#')
         << std::string(std::size_t(bar_width - filled), '.') << "] " << line() << "\x1b[?7h" << std::flush;
  } else {
    if (percent_ >= 0 && percent < percent_ + line_every && (percent < 100 || percent_ == 100)) return;
    out_ << line() << '\n' << std::flush;
  }
  percent_ = percent;
}

void ProgressDisplay::show(const engine::edit::Progress& progress) {
  std::string doing;
  if (progress.interval > 0)
    doing = "interval " + std::to_string(progress.interval) + " of " + std::to_string(progress.intervals) + "  ";
  doing += engine::edit::name_of(progress.stage);
  if (progress.loss) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), ", iteration %d of %d, loss %.3g", progress.iteration, progress.iterations,
                  *progress.loss);
    doing += text.data();
  }
  show(progress.fraction, doing, progress.seconds_left);
}

std::optional<double> ProgressDisplay::guessed_seconds_left(double fraction) const {
  const double elapsed = Seconds(clock_() - start_).count();
  const double done = fraction - first_fraction_.value_or(0);  // since we look: work that goes on begins in its middle
  // A guess from less than this would be noise.
  if (done < 0.05 || elapsed < 1) return std::nullopt;
  return elapsed * (1 - fraction) / done;
}

}  // namespace server::cli
