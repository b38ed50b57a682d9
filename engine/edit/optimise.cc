#include "engine/edit/optimise.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "engine/train/trainer.h"

namespace engine::edit {
namespace {

using working::Role;

/// How fast a row may change, of its rates. What is trusted fully stays as it was deformed: Adam takes no notice of how
/// small a gradient is, and the little that a hole nearby leaves in windows of SSIM would carry a row off at full
/// speed, or at a hundredth of it in four intervals.
float mobility_of(const Goal& goal, std::uint32_t row) { return goal.trust.empty() ? 1.0f : 1.0f - goal.trust[row]; }

/// The rows of M that are trained, ascending.
std::vector<std::uint32_t> rows_to_train(std::span<const std::uint32_t> members, const Goal& goal) {
  std::vector<std::uint32_t> rows;
  std::ranges::set_difference(members, goal.gone, std::back_inserter(rows));
  std::erase_if(rows, [&](std::uint32_t row) { return !(mobility_of(goal, row) > 0); });
  return rows;
}

/// As the trainer takes them.
train::TrainedRows changeable_rows(const working::WorkingScene& working, std::span<const std::uint32_t> rows,
                                   const Goal& goal) {
  train::TrainedRows changeable;
  changeable.cloud = scene::gather(working.cloud(), rows);
  for (const std::uint32_t row : rows) {
    changeable.name.push_back(working.parent()[row]);
    if (!goal.trust.empty()) changeable.mobility.push_back(mobility_of(goal, row));
  }
  return changeable;
}

/// The role of a child that the optimisation gives a row.
constexpr Role child_of(Role role) {
  if (role == Role::relit) return Role::seed;  // new, where it may stay
  return working::is_new(role) ? role : working::is_dragged(role) ? Role::copy : Role::trail;
}

/// Writes what the trainer has made of these rows back, and appends their children.
void take_over(const train::Trainer& trainer, std::span<const std::uint32_t> rows, working::WorkingScene& working) {
  for (std::size_t k = 0; k < rows.size(); ++k) working::copy_row(trainer.cloud(), k, working.gaussians(), rows[k]);
  std::vector<std::uint32_t> children(trainer.cloud().size() - rows.size()), ancestors;
  std::iota(children.begin(), children.end(), std::uint32_t(rows.size()));
  std::vector<Role> roles;
  for (const std::uint32_t child : children) {
    const std::uint32_t ancestor = rows[trainer.ancestors()[child]];
    const Role role = working.role()[ancestor];
    ancestors.push_back(ancestor);
    roles.push_back(child_of(role));
  }
  working.append(trainer.cloud(), children, roles, ancestors);
}

}  // namespace

Result<std::optional<double>> optimise(working::WorkingScene& working, const scene::GaussianCloud& input,
                                       std::span<const scene::Camera> views, std::span<const scene::Mask> masks,
                                       const Goal& goal, const Params& params, const repair::Round& round,
                                       optim::PerceptualLoss& perceptual,
                                       const std::function<Result<void>(const OptimiseProgress&)>& advance) {
  const std::vector<std::uint32_t> rows = rows_to_train(working.member_rows(), goal);
  if (rows.empty()) return std::nullopt;
  std::vector<std::uint32_t> hidden;
  std::ranges::set_union(rows, goal.gone, std::back_inserter(hidden));
  const scene::GaussianCloud originals = working.unedited(input, rows);
  train::Trainer trainer({&working.cloud(), hidden}, changeable_rows(working, rows, goal), scene::capture_extent(views),
                         {}, perceptual);
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (trainer.add_view(working.frame().edit_from_world(views[v]), masks[v], originals)) {
      const std::size_t last = trainer.views() - 1;
      if (const auto picture = goal.picture(v))
        trainer.set_edited(last, scene::cut_out(*picture, trainer.view(last).frozen.region()));
    }
    if (auto going = advance({.set_up = double(v + 1) / double(views.size())}); !going) return propagate(going);
  }
  if (trainer.views() == 0) return std::nullopt;

  std::vector<double> losses(trainer.views(), 0.0);
  trainer.begin_correction({params.seed, round.interval, round.correction}, params.iterations);
  for (int i = 0; i < params.iterations; ++i) {
    const auto done = trainer.step();
    if (!done) return propagate(done);
    losses[done->view] = done->loss;
    if (auto going = advance({1, i + 1, params.iterations, done->loss}); !going) return propagate(going);
  }
  const auto seen = std::min(trainer.views(), std::size_t(params.iterations));
  take_over(trainer, rows, working);
  return std::accumulate(losses.begin(), losses.end(), 0.0) / double(seen);
}

}  // namespace engine::edit
