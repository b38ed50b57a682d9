#include "engine/edit/optimise.h"

#include <algorithm>
#include <numeric>

#include "engine/train/trainer.h"

namespace engine::edit {
namespace {

using working::Role;

// What is trusted fully stays as it was deformed. Adam takes no notice of how small a gradient is: the little that a
// hole nearby leaves in windows of SSIM would carry a row off at full speed, or at a hundredth of it in four intervals.
constexpr float held_by_trust = 1.0f;

/// The rows of M, as the trainer takes them.
train::TrainedRows changeable_rows(const working::WorkingScene& working, std::span<const std::uint32_t> members,
                                   std::span<const float> trust) {
  train::TrainedRows changeable;
  changeable.cloud = scene::gather(working.cloud(), members);
  for (const std::uint32_t row : members) {
    changeable.name.push_back(working.parent()[row]);
    if (!trust.empty()) changeable.mobility.push_back(1 - held_by_trust * trust[row]);
  }
  return changeable;
}

/// The role of a child that the optimisation gives a row.
constexpr Role child_of(Role role) {
  if (role == Role::relit) return Role::seed;  // new, where it may stay
  return working::is_new(role) ? role : working::is_dragged(role) ? Role::copy : Role::trail;
}

/// Writes what the trainer has made of the members back, and appends their children.
void take_over(const train::Trainer& trainer, std::span<const std::uint32_t> members, working::WorkingScene& working) {
  for (std::size_t k = 0; k < members.size(); ++k)
    working::copy_row(trainer.cloud(), k, working.gaussians(), members[k]);
  std::vector<std::uint32_t> children(trainer.cloud().size() - members.size()), ancestors;
  std::iota(children.begin(), children.end(), std::uint32_t(members.size()));
  std::vector<Role> roles;
  for (const std::uint32_t child : children) {
    const std::uint32_t ancestor = members[trainer.ancestors()[child]];
    const Role role = working.role()[ancestor];
    ancestors.push_back(ancestor);
    roles.push_back(child_of(role));
  }
  working.append(trainer.cloud(), children, roles, ancestors);
}

}  // namespace

Result<double> optimise(working::WorkingScene& working, const scene::GaussianCloud& input,
                        std::span<const scene::Camera> views, std::span<const scene::Mask> masks, const Goal& goal,
                        const Params& params, const repair::Round& round, optim::PerceptualLoss& perceptual,
                        const std::function<Result<void>(const OptimiseProgress&)>& advance) {
  const std::vector<std::uint32_t> members = working.member_rows();
  const scene::GaussianCloud originals = working.unedited(input, members);
  train::Trainer trainer({&working.cloud(), members}, changeable_rows(working, members, goal.trust),
                         scene::capture_extent(views), {}, perceptual);
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (trainer.add_view(working.frame().edit_from_world(views[v]), masks[v], originals)) {
      const std::size_t last = trainer.views() - 1;
      if (const auto picture = goal.picture(v))
        trainer.set_edited(last, scene::cut_out(*picture, trainer.view(last).frozen.region()));
    }
    if (auto going = advance({.set_up = double(v + 1) / double(views.size())}); !going) return propagate(going);
  }
  if (trainer.views() == 0) return 0.0;

  std::vector<double> losses(trainer.views(), 0.0);
  trainer.begin_correction({params.seed, round.interval, round.correction}, params.iterations);
  for (int i = 0; i < params.iterations; ++i) {
    const auto done = trainer.step();
    if (!done) return propagate(done);
    losses[done->view] = done->loss;
    if (auto going = advance({1, i + 1, params.iterations, done->loss}); !going) return propagate(going);
  }
  const auto seen = std::min(trainer.views(), std::size_t(params.iterations));
  take_over(trainer, members, working);
  return std::accumulate(losses.begin(), losses.end(), 0.0) / double(seen);
}

}  // namespace engine::edit
