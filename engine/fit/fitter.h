// Fits all Gaussians of a scene to photographs.
// Source: Kerbl et al. 2023, "3D Gaussian Splatting for Real-Time Radiance Field Rendering", sections 5 and 7.1. The
// schedule, made for a few minutes on a processor, is ours.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/result.h"
#include "engine/fit/options.h"
#include "engine/fit/photo.h"
#include "engine/optim/losses.h"
#include "engine/render/frame.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/train/cloud_adam.h"
#include "engine/train/densify.h"

namespace engine::fit {

/// What holds for a part of the iterations.
struct Stage {
  int halvings = 0;   ///< Of the photos.
  int sh_degree = 0;  ///< Bands that are fitted.
  bool operator==(const Stage&) const = default;
};

/// The stage that an iteration (from 0) belongs to: coarse photos and flat colours first, which is quicker by far and
/// settles where things are before it is asked how they look.
///   start_degree  that of the start: bands that exist are fitted from the beginning
[[nodiscard]] Stage stage_of(const FitOptions& options, int start_degree, int iteration);

/// One iteration: render a photo's view, compare, step all Gaussians. View by view, in shuffled epochs. Every so often
/// Gaussians at whose place in the picture the loss pulls get children, up to a number that grows towards
/// max_gaussians, and those that have become invisible go. Same bytes for any number of threads, and for a fit that
/// went on from what write() has kept.
class Fitter {
 public:
  /// Precondition: validate(options); photos and start are not empty; start.sh_degree <= options.sh_degree.
  Fitter(std::vector<Photo> photos, scene::GaussianCloud start, const FitOptions& options);

  [[nodiscard]] const std::vector<Photo>& photos() const { return photos_; }

  [[nodiscard]] int iteration() const { return iteration_; }  ///< Iterations done.
  [[nodiscard]] bool done() const { return iteration_ == options_.iterations; }

  /// The next iteration.
  ///   returns  the loss of its view, before the step
  ///   errors   internal: a parameter, gradient or loss is not finite. `where` names the first
  ///            ("gaussian[12].opacity", by its row in cloud() at that time; "view[0001.jpg].loss"). The fitter is of
  ///            no use any more.
  /// Precondition: !done()
  [[nodiscard]] Result<double> step();

  [[nodiscard]] const scene::GaussianCloud& cloud() const { return cloud_; }

  /// Everything that later iterations depend on, but photos and options.
  void write(ByteWriter& out) const;
  /// What write() of a fitter with the same photos, start and options wrote. Other bytes leave `in` failed, and this
  /// fitter of no use.
  void read(ByteReader& in);

 private:
  void enter(const Stage& stage);
  void densify();
  void prune();
  [[nodiscard]] std::size_t most_gaussians() const;

  FitOptions options_;
  std::vector<Photo> photos_;  ///< As given.
  scene::GaussianCloud cloud_;
  int start_degree_;
  std::size_t start_rows_;
  double extent_;  ///< World units: how far apart things are that the capture tells apart.

  int iteration_ = 0;
  std::optional<Stage> stage_;  ///< None before the first iteration.
  std::vector<Photo> halved_;   ///< Of the stage; empty if its photos are those given.
  std::vector<std::uint32_t> order_;
  train::CloudAdam adam_;
  train::PullStatistic pull_;

  render::Frame frame_;
  render::Gradients gradients_;
  scene::Image rendered_, photo_, v_rendered_;
  optim::LossWorkspace loss_workspace_;
};

/// How near a scene comes to photos.
struct Closeness {
  double psnr_db = 0, ssim = 0;  ///< Means over the photos; pictures clamped to 0 to 1.
  double worst_psnr_db = 0;
  std::string worst_view;
};

/// Renders every view, or `most` of them that are evenly spread. PSNR of equal pictures counts as 100 dB.
/// Precondition: there are photos; most >= 1.
[[nodiscard]] Closeness closeness(const scene::GaussianCloud& cloud, std::span<const Photo> photos, Vec3 background,
                                  std::size_t most = std::numeric_limits<std::size_t>::max());

/// How many of the Gaussians show in any of the photos' views, were they alone but for one another.
[[nodiscard]] std::size_t seen(const scene::GaussianCloud& cloud, std::span<const Photo> photos);

}  // namespace engine::fit
