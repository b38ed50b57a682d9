#include <algorithm>
#include <cmath>

#include "engine/views/views.h"

namespace engine::views {
namespace {

double worth(const Candidate& view) {
  // std::max in this order turns NaN into 0.
  const double source = std::max(0.0, view.source_area), target = std::max(0.0, view.target_area);
  return std::sqrt(source * target) + 0.1 * 0.5 * (source + target);
}

}  // namespace

std::vector<std::size_t> choose_views(std::span<const Candidate> candidates, int count,
                                      std::span<const std::string> excluded) {
  // For unit vectors half the chord is sin(a / 2). Before the first choice there is no nearest view and any number
  // serves, as long as it is the same for all.
  std::vector<double> value(candidates.size()), half_chord(candidates.size(), 1.0);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const bool barred = std::find(excluded.begin(), excluded.end(), candidates[i].name) != excluded.end();
    value[i] = barred ? 0.0 : worth(candidates[i]);
  }
  std::vector<std::size_t> chosen;
  while (int(chosen.size()) < count) {
    std::size_t best = candidates.size();
    double best_score = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const double score = value[i] * (half_chord[i] + 0.05);
      if (score > best_score) best = i, best_score = score;
    }
    if (best == candidates.size()) break;
    chosen.push_back(best);
    value[best] = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i)
      half_chord[i] = std::min(half_chord[i], 0.5 * glm::length(candidates[i].direction - candidates[best].direction));
  }
  return chosen;
}

}  // namespace engine::views
