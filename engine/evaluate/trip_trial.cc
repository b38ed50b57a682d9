#include "engine/evaluate/trip_trial.h"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace engine::evaluate {

Result<TripTrial> carry_out_trip(const scene::GaussianCloud& input, std::span<const scene::Camera> cameras,
                                 const edit::Request& request, const std::string& corrector, std::size_t count,
                                 const Show& show) {
  const auto own = corrector_named(corrector);
  const auto trip = there_and_back(input, cameras, request, own.get());
  if (!trip) return propagate(trip);
  const auto still = zero_drag(input, cameras, request, own.get());
  if (!still) return propagate(still);
  for (std::size_t v = 0; v < std::min(count, trip->cameras.size()); ++v) {
    const std::string name = "trip_" + corrector + "_" + std::to_string(v);
    if (auto shown = show(name, trip_picture(input, *trip, trip->cameras[v])); !shown) return propagate(shown);
  }
  return TripTrial{.request = {},
                   .corrector = corrector,
                   .arrived = trip->arrived,
                   .inside = trip->inside,
                   .outside = trip->outside,
                   .zero_drag = *still,
                   .cameras = trip->cameras.size(),
                   .seconds = trip->seconds};
}

scene::Image trip_picture(const scene::GaussianCloud& input, const RoundTrip& trip, const scene::Camera& camera) {
  scene::Image out(3 * camera.width, camera.height, 3);
  int x = 0;
  for (const scene::GaussianCloud* cloud : {&input, &trip.halfway, &trip.back}) {
    scene::paste(picture(*cloud, camera), {x, 0, x + camera.width, camera.height}, out);
    x += camera.width;
  }
  return out;
}

std::string summary(const TripTrial& trial) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(2) << "there and back, " << trial.corrector << ": " << 100 * trial.arrived
      << " % of the drag arrived; inside " << trial.inside.psnr_db << " dB, outside " << trial.outside.psnr_db
      << " dB; " << std::setprecision(1) << trial.seconds << " s there; zero drag, inside " << trial.zero_drag.psnr_db
      << " dB\n";
  return out.str();
}

}  // namespace engine::evaluate
