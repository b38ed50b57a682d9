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

/// A part of the schedule: photos and bands that are the same for a range of iterations.
struct Phase {
  int halvings = 0;   ///< Times that the photos are halved.
  int sh_degree = 0;  ///< SH degree that is fitted.
  bool operator==(const Phase&) const = default;
};

/// The phase that an iteration (from 0) belongs to: coarse photos and flat colours first, which is quicker by far and
/// settles where things are before how they look.
///   start_degree  SH degree of the start: bands that it has are fitted from the beginning
[[nodiscard]] Phase phase_of(const FitOptions& options, int start_degree, int iteration);

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

  /// Writes everything that later iterations depend on, but photos and options.
  void write(ByteWriter& out) const;
  /// Reads what write() of a fitter with the same photos, start and options wrote. Other bytes leave `in` failed, and
  /// this fitter must not be used any more.
  void read(ByteReader& in);

 private:
  void enter(const Phase& phase);
  void densify();
  void prune();
  [[nodiscard]] std::size_t max_gaussians_now() const;

  FitOptions options_;
  std::vector<Photo> photos_;  ///< The photos as given.
  scene::GaussianCloud cloud_;
  int start_degree_;
  std::size_t start_rows_;
  double extent_;  ///< World units: extent of the capture, by which rates of positions go.

  int iteration_ = 0;
  std::optional<Phase> phase_;  ///< None before the first iteration.
  std::vector<Photo> halved_;   ///< Photos of the phase; empty if they are those given.
  std::vector<std::uint32_t> order_;
  train::CloudAdam adam_;
  train::PositionGradientStatistic position_gradients_;

  render::Frame frame_;
  render::Gradients gradients_;
  scene::Image rendered_, photo_, v_rendered_;
  optim::LossWorkspace loss_workspace_;
};

/// How near renders of a scene come to photos.
struct FitQuality {
  double psnr_db = 0, ssim = 0;  ///< Means over the photos; pictures clamped to 0 to 1.
  double worst_psnr_db = 0;      ///< Smallest PSNR of a photo.
  std::string worst_view;        ///< Name of its view.
};

/// Renders every view, or `max_views` of them that are evenly spread. PSNR of equal pictures counts as 100 dB.
/// Precondition: there are photos; max_views >= 1.
[[nodiscard]] FitQuality quality_on(const scene::GaussianCloud& cloud, std::span<const Photo> photos, Vec3 background,
                                    std::size_t max_views = std::numeric_limits<std::size_t>::max());

/// Number of Gaussians that have a weight above 0 in a pixel of any photo's view.
[[nodiscard]] std::size_t visible_count(const scene::GaussianCloud& cloud, std::span<const Photo> photos);

}  // namespace engine::fit
