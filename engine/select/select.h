// Carries out a selection on a scene.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/render/forward.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/neighbourhood.h"
#include "engine/select/operation.h"
#include "engine/select/shapes.h"

namespace engine::select {

/// Something about a selection that a person should know.
struct Warning {
  std::string message;  ///< One sentence.
  std::string where;    ///< "selection[2]", "selection[2].grow.wider", or "selection" for all of it.
  bool operator==(const Warning&) const = default;
};

/// Where the border of a whole lies among the natural borders around its click: what one who widens it step by step has
/// to know.
struct WholeBorder {
  int wider = 0;      ///< Grow::wider, or nearer to 0 where there are fewer borders on that side.
  bool more = false;  ///< One may lie farther out. A reach that nobody has looked beyond yet may hold one, or none.
  bool less = false;  ///< One lies farther in.
  bool operator==(const WholeBorder&) const = default;
};

/// The rows that are meant.
struct Selected {
  RowSet rows;                ///< [N] 1: selected; as scene::select() takes it.
  std::size_t count = 0;      ///< Selected rows.
  scene::Bounds bounds;       ///< Of their means, world units; {0,0,0} twice where none is selected.
  DVec3 centre{0.0};          ///< Mean of their means, world units; 0 where none is selected.
  std::size_t undecided = 0;  ///< Rows that masks leave nearly even: MaskedRows::undecided, over all operations.
  std::optional<WholeBorder> border;  ///< Of the last operation that grows a whole.
  std::vector<Warning> warnings;      ///< Nothing is selected; an operation names no row; there is no such border.
};

/// Selects in one scene, and keeps what the next selection there can use: a user clicks on, and each click asks for all
/// operations once more. Results do not depend on what is kept. Not for two threads at once.
class Selector {
 public:
  /// Keeps a reference to the cloud, which has to stay as it is.
  explicit Selector(const scene::GaussianCloud& cloud) : cloud_(cloud) {}
  explicit Selector(const scene::GaussianCloud&& cloud) = delete;

  /// The operations in order, each on what those before it have selected; the first on nothing. The same bytes for any
  /// number of threads; operations on pictures may differ between instruction sets where a row is on the verge.
  ///   errors  those of validate(); corrupt_data, `where` = "[12].x": see scene::first_not_finite(); unprocessable,
  ///           `where` = "selection[2].grow.inside[1]": see Neighbourhood::grow()
  [[nodiscard]] Result<Selected> select(const Selection& selection);

 private:
  [[nodiscard]] Result<void> carry_out(const Operation& operation, const std::string& where, Selected& so_far);
  [[nodiscard]] Result<RowSet> rows_of(const Grow& grow, const std::string& where, Selected& so_far);
  /// Of all clicks; where an outside point is on what the inside points alone take, no more than that.
  [[nodiscard]] Result<Grown> grown(const Grow& grow);
  struct Found {
    Grow grow;
    Grown grown;
    Surroundings surroundings;
  };
  /// What is kept of a question, as the latest from now on; else what find() answers, which is kept.
  template <class Find>
  [[nodiscard]] static Result<const Found*> kept_or_found(std::vector<Found>& kept, const Grow& grow, Find&& find);
  /// What grows there. errors  those of Neighbourhood::grow()
  [[nodiscard]] Result<Found> found_within(const Grow& grow, const Surroundings& surroundings);
  /// Does what was found come so near to the reach that this may have cut it?
  [[nodiscard]] static bool comes_near_reach(const Array3& mean, const Found& found);
  /// The whole, without a reach and whatever `wider` says. The scene says how far its surroundings reach: by half of
  /// its rows, of which a thing in the middle of a capture may have most. Where the whole has most of those within the
  /// reach and comes near to it, and in twice the reach, or four times, ends well before it and at a border that is
  /// worth it, that counts. Stays until the next call.
  ///   errors  those of Neighbourhood::grow()
  [[nodiscard]] Result<const Found*> whole_of(Grow grow);
  [[nodiscard]] Result<Found> find_whole(const Grow& grow);
  /// Of a whole without a reach: where its surroundings have no border farther out, the next ones are looked for in
  /// twice the reach, and again.
  ///   surroundings  set to those that were looked at last
  [[nodiscard]] Result<Grown> grown_anywhere(const Grow& grow, Surroundings& surroundings);
  /// Adds what the first click means as a whole, so many borders farther out, where no outside point is on it and both
  /// together end about as well: further clicks are rarely meant to take anything away from it, unless they are on it.
  ///   surroundings  of `out`; widened to those of the whole
  ///   returns       whether that is so; then borders farther out and in are those of the first click
  bool join_first(const Grow& grow, int wider, Surroundings& surroundings, Grown& out);
  /// The same as far out as is asked for, else for the whole as it is; not where a reach is asked for.
  void keep_first(const Grow& grow, Surroundings& surroundings, Grown& out);
  /// What a person sees who has not clicked beside the thing yet. Stays until the next call.
  [[nodiscard]] Result<const Found*> by_inside_alone(Grow grow);
  [[nodiscard]] RowSet rows_of(const Masks& masks, Selected& so_far);
  [[nodiscard]] const Neighbourhood& neighbourhood(const Surroundings& surroundings);

  const scene::GaussianCloud& cloud_;
  bool is_checked_ = false;  ///< Are all values finite?
  render::Workspace workspace_;
  std::vector<std::unique_ptr<const Neighbourhood>> neighbourhoods_;  ///< The latest, latest last.
  std::vector<Found> wholes_;        ///< The latest, latest last: the same one is narrowed and widened.
  std::vector<Found> inside_alone_;  ///< The latest, latest last: outside clicks come one after the other.
};

/// The same, for a single selection.
[[nodiscard]] Result<Selected> select(const scene::GaussianCloud& cloud, const Selection& selection);

}  // namespace engine::select
