// Pictures for people who wait for them: fair, bounded, and ahead of edits that run for minutes.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/fair_semaphore.h"
#include "engine/core/memory_budget.h"
#include "engine/core/parallel.h"
#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/io/image_file.h"
#include "engine/render/forward.h"
#include "engine/render/pick.h"
#include "engine/scene/camera.h"
#include "server/edits/selections.h"
#include "server/pictures/picture_content.h"
#include "server/scenes/scene_store.h"

namespace server::service {

using engine::Result;
using pictures::PictureContent;

/// Limits of the renders that people wait for.
struct RenderServiceOptions {
  int threads = 0;                         ///< Pictures made at a time; 0: as many as the machine has cores.
  std::size_t max_waiting = 64;            ///< Requests that may wait for their turn; more are busy.
  int max_side = 4096;                     ///< Most pixels of a side of a picture.
  engine::MemoryBudget* memory = nullptr;  ///< Lends what a picture takes while it is made; null: nobody counts it.
  std::string program = {};                ///< Release of the program: another one may make other bytes.
};

/// What a picture is to show, and how.
struct PictureOrder {
  engine::scene::Camera camera;
  PictureContent content = PictureContent::color;
  engine::io::ImageFormat format = engine::io::ImageFormat::jpeg;
  engine::Vec3 background{0.0f};                                    ///< Display-referred.
  int sh_degree = engine::scene::max_sh_degree;                     ///< Bands above are left out.
  int quality = 90;                                                 ///< Quality of a JPEG, 1 to 100.
  std::shared_ptr<const edits::MadeSelection> selection = nullptr;  ///< Made on the version: its rows are tinted.
};

/// A picture as a file.
struct Picture {
  std::string bytes;                    ///< In the format that was ordered.
  double render_ms = 0, encode_ms = 0;  ///< Wall time, milliseconds.
};

/// Safe to call from any thread.
class RenderService {
 public:
  /// Its threads, which all arenas share, are started here: they have the priority of this thread for good.
  explicit RenderService(const RenderServiceOptions& options);

  /// Names the bytes of a picture before it is made: the same order of the same version has the same bytes by this
  /// program on this instruction set, for ever.
  [[nodiscard]] std::string etag(const scenes::LoadedVersion& version, const PictureOrder& order) const;

  /// Makes the picture.
  ///   errors  invalid_argument: a camera that is none; too_large: names the limit; busy; those of MemoryBudget::take()
  [[nodiscard]] Result<Picture> render(const scenes::LoadedVersion& version, const PictureOrder& order);

  /// Linear floats of the version's colours. Errors as render().
  [[nodiscard]] Result<engine::scene::Image> colors(const scenes::LoadedVersion& version,
                                                    const engine::scene::Camera& camera);

  /// What engine::render::pick() finds. Errors as render().
  [[nodiscard]] Result<std::optional<engine::render::PixelHit>> pick(const scenes::LoadedVersion& version,
                                                                     const engine::scene::Camera& camera,
                                                                     engine::DVec2 pixel);

  /// Does other work that somebody waits for, in its turn and on the same threads.
  ///   errors  busy; too_large: it does not fit into memory
  [[nodiscard]] Result<void> run_in_turn(const std::function<void()>& work);

  /// Requests that wait for their turn.
  [[nodiscard]] std::size_t waiting() const { return slots_.waiting(); }
  [[nodiscard]] const RenderServiceOptions& options() const { return options_; }

 private:
  /// Memory that pictures are made in, one after the other.
  struct Canvas {
    engine::render::Workspace workspace;
    engine::render::Rendering rendering;
  };

  Result<void> check(const engine::scene::Camera& camera) const;
  /// Calls `work` with a canvas that nobody else uses, in memory for a picture of that version.
  Result<void> on_canvas(const scenes::LoadedVersion& version, const engine::scene::Camera& camera,
                         const std::function<void(Canvas&)>& work);

  const RenderServiceOptions options_;
  engine::WorkArena arena_;
  engine::FairSemaphore slots_;
  std::mutex mutex_;  ///< Guards canvases_.
  /// Not one per thread: while a thread waits within a rendering, oneTBB may have it begin another one.
  std::vector<std::unique_ptr<Canvas>> canvases_;
};

}  // namespace server::service
