#include "engine/select/select.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <numeric>
#include <span>
#include <type_traits>
#include <utility>
#include <variant>

#include "engine/select/shown.h"
#include "engine/select/spread.h"

namespace engine::select {
namespace {

/// Kept between selections: of a list that grows several things. 25 MB each for the graph, and 8 bytes for each row
/// that is no node: of those, so many in all, but for the latest.
constexpr std::size_t neighbourhoods_kept = 4, rows_kept = 4'000'000;
/// The same of what inside points alone take, and of wholes, of which a thing of several clicks has two: four bytes for
/// each row.
constexpr std::size_t grown_kept = 8;

/// Of a scene, more is hardly ever what people mean by points inside alone. A choice.
constexpr double most_meant = 0.5;
/// So often the reach of a whole is doubled in search of a border farther out: then it holds nearly all of a scene.
constexpr int farther_reaches = 2;

// Where nearly all of a whole ends only beyond this share of its reach, the reach may have cut it, and no border.
constexpr double near_reach = 0.65, nearly_all = 0.99;
// Times the rows of a whole that was cut: more is another thing. Chosen on random clicks (ADR 69): what was cut had up
// to 2.97 times as many, a table with all on it 3.5 times.
constexpr double more_beyond_reach = 3;

// What the first click means besides joins what all clicks take where the border of both costs at most so many times
// that of the latter, and they are at most so much larger: more is another thing than these clicks span (ADR 72). Who
// asks for the whole asks for the farthest of borders that are nearly as weak, however much is within.
constexpr double alike = 1.05, little_more = 1.25;

/// What selecting reads of a scene has to be finite: a NaN would be on no side of anything.
Result<void> check_finite(const scene::GaussianCloud& cloud) {
  const auto bad = scene::first_not_finite(cloud);
  if (!bad) return {};
  return fail(ErrorCode::corrupt_data, "a value of a Gaussian is not a finite number", *bad);
}

void combine(Op op, const RowSet& named, RowSet& selected) {
  const auto each = [&](auto&& combined) {
    std::transform(selected.begin(), selected.end(), named.begin(), selected.begin(), combined);
  };
  switch (op) {
    case Op::add:
      return each(std::bit_or<std::uint8_t>());
    case Op::subtract:
      return each([](std::uint8_t before, std::uint8_t row) { return std::uint8_t(before & ~row); });
    case Op::intersect:
      return each(std::bit_and<std::uint8_t>());
  }
}

/// Fills in what is told of the rows.
void describe(const Array3& mean, Selected& out) {
  DVec3 sum(0.0);
  for (std::size_t row = 0; row < out.rows.size(); ++row) {
    if (out.rows[row] == 0) continue;
    const Vec3 at = mean.get(row);
    out.bounds.low = out.count == 0 ? at : glm::min(out.bounds.low, at);
    out.bounds.high = out.count == 0 ? at : glm::max(out.bounds.high, at);
    sum += DVec3(at);
    ++out.count;
  }
  if (out.count > 0) out.centre = sum / double(out.count);
}

/// Is a larger thing the one that was meant, where a smaller one may have been cut? Who clicks on a thing of so many
/// times the rows is so many times less likely to click where the smaller one is (the size principle, see
/// natural_border()): the border has to be weaker by as much.
bool is_worth_it(const Neighbourhood& around, std::span<const std::uint32_t> smaller,
                 std::span<const std::uint32_t> larger) {
  const double more = double(larger.size()) / double(smaller.size());
  return more <= more_beyond_reach && more * around.border_ratio(larger) <= around.border_ratio(smaller);
}

bool is_empty(const RowSet& rows) { return std::find(rows.begin(), rows.end(), std::uint8_t{1}) == rows.end(); }

}  // namespace

bool Selector::comes_near_reach(const Array3& mean, const Found& found) {
  std::vector<double> squared;
  for (const std::uint32_t row : found.grown.rows) {
    const DVec3 offset = DVec3(mean.get(row)) - found.surroundings.middle;
    squared.push_back(glm::dot(offset, offset));
  }
  if (squared.empty()) return false;
  const auto last = squared.begin() + std::ptrdiff_t(nearly_all * double(squared.size() - 1));
  std::ranges::nth_element(squared, last);
  return std::sqrt(*last) > near_reach * found.surroundings.reach;
}

const Neighbourhood& Selector::neighbourhood(const Surroundings& surroundings) {
  const auto kept = std::find_if(neighbourhoods_.begin(), neighbourhoods_.end(),
                                 [&](const auto& one) { return one->surroundings() == surroundings; });
  if (kept != neighbourhoods_.end()) {
    std::rotate(kept, kept + 1, neighbourhoods_.end());
  } else {
    neighbourhoods_.push_back(std::make_unique<const Neighbourhood>(cloud_, surroundings));
    const auto rows = [&] {
      return std::transform_reduce(neighbourhoods_.begin(), neighbourhoods_.end(), std::size_t{0}, std::plus<>(),
                                   [](const auto& one) { return one->size(); });
    };
    while (neighbourhoods_.size() > neighbourhoods_kept || (neighbourhoods_.size() > 1 && rows() > rows_kept))
      neighbourhoods_.erase(neighbourhoods_.begin());
  }
  return *neighbourhoods_.back();
}

template <class Find>
Result<const Selector::Found*> Selector::kept_or_found(std::vector<Found>& kept, const Grow& grow, Find&& find) {
  const auto at = std::ranges::find(kept, grow, &Found::grow);
  if (at != kept.end()) {
    std::rotate(at, at + 1, kept.end());
  } else {
    Result<Found> found = find();
    if (!found) return propagate(found);
    if (kept.size() == grown_kept) kept.erase(kept.begin());
    kept.push_back(*std::move(found));
  }
  return &kept.back();
}

Result<Selector::Found> Selector::found_within(const Grow& grow, const Surroundings& surroundings) {
  auto grown = neighbourhood(surroundings).grow(cloud_, grow);
  if (!grown) return propagate(grown);
  return Found{grow, *std::move(grown), surroundings};
}

Result<Selector::Found> Selector::find_whole(const Grow& grow) {
  Surroundings surroundings = surroundings_of(cloud_.mean, grow);
  auto whole = found_within(grow, surroundings);
  if (!whole) return whole;
  const bool has_most = 2 * whole->grown.rows.size() > neighbourhood(surroundings).size();
  if (!has_most || !comes_near_reach(cloud_.mean, *whole)) return whole;
  for (int reaches = 0; reaches < farther_reaches && neighbourhood(surroundings).size() < cloud_.size(); ++reaches) {
    surroundings.reach *= 2;
    auto larger = found_within(grow, surroundings);
    if (!larger) break;
    if (comes_near_reach(cloud_.mean, *larger)) continue;
    return is_worth_it(neighbourhood(surroundings), whole->grown.rows, larger->grown.rows) ? larger : whole;
  }
  return whole;
}

Result<const Selector::Found*> Selector::whole_of(Grow grow) {
  grow.wider = 0;
  return kept_or_found(wholes_, grow, [&] { return find_whole(grow); });
}

Result<Grown> Selector::grown_anywhere(const Grow& grow, Surroundings& surroundings) {
  if (!grow.whole || grow.reach) {
    surroundings = surroundings_of(cloud_.mean, grow);
    return neighbourhood(surroundings).grow(cloud_, grow);
  }
  const auto whole = whole_of(grow);
  if (!whole) return propagate(whole);
  surroundings = (*whole)->surroundings;
  const Neighbourhood* around = &neighbourhood(surroundings);
  Result<Grown> out = grow.wider == 0 ? Result<Grown>((*whole)->grown) : around->grow(cloud_, grow);
  int reaches = 0;
  const auto is_more_to_look_at = [&] { return reaches < farther_reaches && around->size() < cloud_.size(); };
  for (; out && out->wider < grow.wider && is_more_to_look_at(); ++reaches) {
    surroundings.reach *= 2;
    around = &neighbourhood(surroundings);
    const Grown within = *std::move(out);
    out = around->grow_beyond(cloud_, grow, within.rows, grow.wider - within.wider);
    if (!out) break;
    out->wider += within.wider;
    out->less = out->less || within.less;
  }
  // Not looked for: it would cost a walk that nobody has asked for.
  if (out) out->more = out->more || (out->wider >= grow.wider && is_more_to_look_at());
  return out;
}

bool Selector::join_first(const Grow& grow, int wider, Surroundings& surroundings, Grown& out) {
  Grow first{.inside = {grow.inside.front()}, .outside = {}, .reach = {}, .whole = true, .wider = wider};
  Surroundings of_first;
  const auto meant = grown_anywhere(first, of_first);
  if (!meant) return false;
  surroundings.reach = std::max(surroundings.reach, of_first.reach);
  const Neighbourhood& around = neighbourhood(surroundings);
  if (around.may_be_on(cloud_, grow, meant->rows)) return false;
  std::vector<std::uint32_t> both;
  std::ranges::set_union(out.rows, meant->rows, std::back_inserter(both));
  if (around.border_ratio(both) > (grow.whole ? nearly_as_weak : alike) * around.border_ratio(out.rows)) return false;
  if (!grow.whole && around.area(both) > little_more * around.area(out.rows)) return false;
  out = {std::move(both), meant->wider, meant->more, meant->less};
  return true;
}

void Selector::keep_first(const Grow& grow, Surroundings& surroundings, Grown& out) {
  const bool is_one_click = grow.inside.size() + grow.outside.size() == 1;
  if (is_one_click || grow.reach) return;
  // Where an outside point is on what lies farther out, the whole stays all the same.
  if (!join_first(grow, grow.wider, surroundings, out) && grow.wider > 0) join_first(grow, 0, surroundings, out);
}

Result<const Selector::Found*> Selector::by_inside_alone(Grow grow) {
  grow.outside.clear();
  return kept_or_found(inside_alone_, grow, [&]() -> Result<Found> {
    Surroundings surroundings;
    auto grown = grown_anywhere(grow, surroundings);
    if (!grown) return propagate(grown);
    keep_first(grow, surroundings, *grown);
    return Found{grow, *std::move(grown), surroundings};
  });
}

Result<Grown> Selector::grown(const Grow& grow) {
  const auto alone = by_inside_alone(grow);
  if (grow.outside.empty()) {
    if (!alone) return propagate(alone);
    return (*alone)->grown;
  }
  Surroundings surroundings;
  auto out = grown_anywhere(grow, surroundings);
  // In their own surroundings, inside points may be too far from each other: nobody has seen them without the others.
  if (!out || !alone) return out;
  const Grown before = (*alone)->grown;
  surroundings.reach = std::max(surroundings.reach, (*alone)->surroundings.reach);
  if (!neighbourhood(surroundings).may_be_on(cloud_, grow, before.rows)) {
    keep_first(grow, surroundings, *out);
    return out;
  }
  // Whoever clicks outside on what is taken wants less of it.
  if (out->rows.size() > before.rows.size()) {
    auto left = neighbourhood(surroundings).left_of(cloud_, grow, before.rows);
    if (!left) return propagate(left);
    if (!left->empty()) out = Grown{*std::move(left), before.wider, before.more, before.less};
  }
  Grown kept = *out;
  keep_first(grow, surroundings, kept);
  std::vector<std::uint32_t> of_before;
  std::ranges::set_intersection(kept.rows, before.rows, std::back_inserter(of_before));
  kept.rows.clear();
  std::ranges::set_union(out->rows, of_before, std::back_inserter(kept.rows));
  return kept;
}

Result<RowSet> Selector::rows_of(const Grow& grow, const std::string& where, Selected& so_far) {
  RowSet named(cloud_.size(), 0);
  if (cloud_.size() == 0) return named;
  const auto found = grown(grow);
  if (!found) return fail(found.error().code, found.error().message, where + ".grow." + found.error().where);
  for (const std::uint32_t row : found->rows) named[row] = 1;
  if (grow.whole) so_far.border = WholeBorder{found->wider, found->more, found->less};
  if (found->wider != grow.wider)
    so_far.warnings.push_back({"there is no border farther " + std::string(grow.wider > 0 ? "out" : "in") +
                                   " than wider = " + std::to_string(found->wider),
                               where + ".grow.wider"});
  return named;
}

RowSet Selector::rows_of(const Masks& masks, Selected& so_far) {
  MaskedRows masked = rows_in_masks(cloud_, masks, workspace_);
  so_far.undecided += masked.undecided;
  const auto surroundings = surroundings_of(cloud_.mean, masked.inside);
  if (!surroundings) return std::move(masked.shaded);  // all of it lies behind glass, or haze
  std::vector<Given> given(cloud_.size(), Given::no);
  for (std::size_t row = 0; row < given.size(); ++row)
    if (masked.judged[row] != 0) given[row] = masked.inside[row] != 0 ? Given::inside : Given::outside;
  for (const std::uint32_t row : neighbourhood(*surroundings).settle(given, masked.shaded)) masked.inside[row] = 1;
  return std::move(masked.inside);
}

Result<void> Selector::carry_out(const Operation& operation, const std::string& where, Selected& so_far) {
  const Array3& mean = cloud_.mean;
  return std::visit(
      [&](const auto& action) -> Result<void> {
        using Kind = std::decay_t<decltype(action)>;
        if constexpr (std::is_same_v<Kind, Expand>) {
          so_far.rows = expanded(mean, so_far.rows, action.distance);
        } else if constexpr (std::is_same_v<Kind, Shrink>) {
          so_far.rows = shrunk(mean, so_far.rows, action.distance);
        } else if constexpr (std::is_same_v<Kind, Largest>) {
          so_far.rows = largest_pieces(mean, so_far.rows, std::size_t(action.n));
        } else if constexpr (std::is_same_v<Kind, Invert>) {
          for (std::uint8_t& row : so_far.rows) row = std::uint8_t(1 - row);
        } else {
          RowSet named;
          if constexpr (std::is_same_v<Kind, Grow>) {
            auto grown = rows_of(action, where, so_far);
            if (!grown) return propagate(grown);
            named = *std::move(grown);
          } else if constexpr (std::is_same_v<Kind, Masks>) {
            named = rows_of(action, so_far);
          } else if constexpr (std::is_same_v<Kind, Polygon> || std::is_same_v<Kind, Stroke>) {
            named = rows_in(cloud_, action, workspace_);
          } else {
            named = rows_in(mean, action);
          }
          if (is_empty(named))
            so_far.warnings.push_back(
                {"the " + std::string(name_of(operation.action)) +
                     (std::holds_alternative<Masks>(operation.action) || std::holds_alternative<Rows>(operation.action)
                          ? " name no Gaussian"
                          : " names no Gaussian"),
                 where});
          combine(operation.op, named, so_far.rows);
        }
        return {};
      },
      operation.action);
}

Result<Selected> Selector::select(const Selection& selection) {
  if (auto valid = validate(selection, cloud_.size()); !valid) return propagate(valid);
  if (!is_checked_) {
    if (auto finite = check_finite(cloud_); !finite) return propagate(finite);
    is_checked_ = true;
  }
  Selected out;
  out.rows.assign(cloud_.size(), 0);
  for (std::size_t i = 0; i < selection.size(); ++i)
    if (auto done = carry_out(selection[i], address(i), out); !done) return propagate(done);
  describe(cloud_.mean, out);
  if (out.count == 0) out.warnings.push_back({"nothing is selected", "selection"});
  if (double(out.count) > most_meant * double(cloud_.size()))
    for (std::size_t i = 0; i < selection.size(); ++i)
      if (const auto* grow = std::get_if<Grow>(&selection[i].action);
          grow != nullptr && selection[i].op == Op::add && grow->outside.empty())
        out.warnings.push_back(
            {"most of the scene is selected: a point outside, on what is not meant, takes less", address(i) + ".grow"});
  return out;
}

Result<Selected> select(const scene::GaussianCloud& cloud, const Selection& selection) {
  return Selector(cloud).select(selection);
}

}  // namespace engine::select
