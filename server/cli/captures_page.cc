#include "server/cli/captures_page.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <vector>

#include "engine/captures/captured_case.h"
#include "engine/core/names.h"
#include "server/cli/bench_edit.h"

namespace server::cli {
namespace {

using engine::captures::CaptureTrial;

constexpr const char* how =
    "A made-up scene is photographed before an edit and after it: 30 photos of 320x240 from a part of an orbit, with\n"
    "noise and an exposure of their own. `splatdrag fit` trains a scene from the photos before, starting from sparse,\n"
    "noisy points. A person's request is carried out on it: at most three handles per part, on surfaces, off by 2 % "
    "of\n"
    "their length. What comes of it is held against photographs of the true result, without noise, at six cameras\n"
    "within the orbit and four beyond it. What moves is said **by**\n\n"
    "- **balls** around the handles, large ones, cut to a box where the case has one that a person would hardly draw;\n"
    "- **bare** balls, as 3DGS-Drag has them, of the size that matches the truth best: nobody could choose a better "
    "one;\n"
    "- a selection that grows from at most six **clicks** fixed beforehand;\n"
    "- the same from the first of these clicks alone (**click**), as on the page: it means the whole, and up to three\n"
    "  borders more or less are asked for, whichever matches the truth best;\n"
    "- the same from the clicks of a person who is **looking**: up to six, each goes to the largest patch that is\n"
    "  tinted wrongly in six photos' views, and is undone if it makes things worse;\n"
    "- the same by **correcting**: a click that makes things worse is first corrected by the next, on the largest "
    "patch\n"
    "  that is wrong the other way (too much was taken along, so this is not it); if that does not help, both go;\n"
    "- **masks** of three photos, lifted: the true outline; **wide masks**: 5 pixels more all around.\n\n"
    "The columns:\n\n"
    "- **before**, **deformed**, **edited**, **ceiling**: PSNR of the edited region, of the trained scene as it is, "
    "of\n"
    "  the deformation alone (preset `preview`), of the edit, and of a scene that is trained from photos after the "
    "edit.\n"
    "- **gain**: of the edit over deformation alone. **share**: the part of the way from *before* to *ceiling* that "
    "the\n"
    "  edit goes. **beyond**: *edited* at the cameras outside the orbit only.\n"
    "- **outside**, **vacated**, **arrived**, **SSIM** (of the edited region): of the edit.\n"
    "- **least gain**: over deformation alone in the region that gains least, be it edited, vacated, arrived or "
    "outside:\n"
    "  below zero, the repair did harm there. **vacated gain**: in the vacated region; **vacated share**: that in "
    "parts "
    "of\n"
    "  what the ceiling gains there. **vacated detail**: fine structure there in parts of the truth's, whatever it "
    "shows:\n"
    "  dB are best for a smear, 100 % look like the rest. Of means, *least gain* is the least of all cases.\n"
    "- **recall**, **precision**: of what the request takes along with what moves, by opacity times area; **of "
    "shown**:\n"
    "  by what the photos show, without the undersides and insides that nobody has seen.\n"
    "- **over bare** (of means): *edited*, beside that of bare balls on the same cases.\n"
    "- **set**: constants may be chosen on `choose`, and never on `test`. That holds for the first take: other photos "
    "and\n"
    "  other errors of the hand (`--take 2` and so on) are all for testing.\n\n";

/// What an edit gains over the same by bare balls, dB of the edited region. Nothing where those were not tried.
std::optional<double> gain_over_bare_balls(std::span<const CaptureTrial> trials, const CaptureTrial& one) {
  for (const CaptureTrial& other : trials)
    if (other.by == "bare" && other.trial.name == one.trial.name && other.trial.corrector == one.trial.corrector)
      return one.trial.result.edited.psnr_db - other.trial.result.edited.psnr_db;
  return std::nullopt;
}

struct Mean {
  int count = 0, beside_bare = 0, vacating = 0, shared = 0;
  double over_bare = 0, least_gain = std::numeric_limits<double>::infinity(), vacated_gain = 0, vacated_share = 0;
  double gain = 0, deformed = 0, edited = 0, ceiling = 0, share = 0, outside = 0, recall = 0, precision = 0,
         shown_recall = 0, shown_precision = 0;
};

/// Of one set, one way to say what moves, and one corrector.
Mean mean_of(std::span<const CaptureTrial> trials, bool is_test, const std::string& by, const std::string& corrector) {
  Mean mean;
  for (const CaptureTrial& trial : trials) {
    if (trial.is_test != is_test || trial.by != by || trial.trial.corrector != corrector) continue;
    ++mean.count;
    mean.gain += trial.gain_db(), mean.deformed += trial.deformed.edited.psnr_db;
    mean.edited += trial.trial.result.edited.psnr_db, mean.ceiling += trial.ceiling.edited.psnr_db;
    mean.share += trial.share_of_ceiling().value_or(0), mean.outside += trial.trial.result.outside.psnr_db;
    mean.recall += trial.match.recall, mean.precision += trial.match.precision;
    mean.shown_recall += trial.shown.recall, mean.shown_precision += trial.shown.precision;
    if (const auto gain = gain_over_bare_balls(trials, trial)) ++mean.beside_bare, mean.over_bare += *gain;
    mean.least_gain = std::min(mean.least_gain, trial.least_gain_db());
    if (const auto gain = trial.vacated_gain_db()) ++mean.vacating, mean.vacated_gain += *gain;
    if (const auto share = trial.vacated_share()) ++mean.shared, mean.vacated_share += *share;
  }
  mean.over_bare /= std::max(1, mean.beside_bare);
  mean.vacated_gain /= std::max(1, mean.vacating), mean.vacated_share /= std::max(1, mean.shared);
  for (double* sum : {&mean.gain, &mean.deformed, &mean.edited, &mean.ceiling, &mean.share, &mean.outside, &mean.recall,
                      &mean.precision, &mean.shown_recall, &mean.shown_precision})
    *sum /= std::max(1, mean.count);
  return mean;
}

std::string means(std::span<const CaptureTrial> trials, const BenchOptions& options) {
  std::ostringstream out;
  out << "| set | by | corrector | cases | deformed, dB | edited, dB | gain, dB | least gain, dB | ceiling, dB | "
         "share, % "
         "| outside, dB | vacated gain, dB | vacated share, % | "
         "recall, % | precision, % | recall of shown, % | precision of shown, % | over bare, dB |\n"
         "| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: "
         "| ---: | ---: |\n"
      << std::fixed;
  const auto add = [&](bool is_test, const std::string& by, const std::string& corrector) {
    const Mean mean = mean_of(trials, is_test, by, corrector);
    if (mean.count == 0) return;
    out << "| " << (is_test ? "test" : "choose") << " | " << by << " | " << corrector << " | " << mean.count
        << std::setprecision(2) << " | " << mean.deformed << " | " << mean.edited << " | " << mean.gain << " | "
        << mean.least_gain << " | " << mean.ceiling << " | " << std::setprecision(0) << 100 * mean.share
        << std::setprecision(2) << " | " << mean.outside << " | " << mean.vacated_gain << std::setprecision(0) << " | "
        << 100 * mean.vacated_share << " | " << 100 * mean.recall << " | " << 100 * mean.precision << " | "
        << 100 * mean.shown_recall << " | " << 100 * mean.shown_precision << " | ";
    if (mean.beside_bare > 0)
      out << std::setprecision(2) << mean.over_bare;
    else
      out << '-';
    out << " |\n";
  };
  for (const bool is_test : {false, true})
    for (const std::string& by : options.captures.by)
      for (const std::string& corrector : options.correctors) add(is_test, by, corrector);
  return out.str();
}

/// What each case is about, and which are missing.
std::string cases(std::span<const CaptureTrial> trials) {
  std::ostringstream out;
  std::set<std::string> told;
  for (const CaptureTrial& trial : trials) {
    if (!told.insert(trial.trial.name).second) continue;
    out << "- `" << trial.trial.name << "`" << (trial.is_test ? " (test)" : "") << ": " << trial.trial.what;
    if (!trial.said.empty()) out << ' ' << trial.said;
    out << '\n';
  }
  std::string missing;
  for (const std::string& name : engine::captures::captured_case_names())
    if (!told.contains(name)) missing += (missing.empty() ? "" : ", ") + ("`" + name + "`");
  if (!missing.empty()) out << "\nNot carried out for this page: " << missing << ".\n";
  return out.str();
}

}  // namespace

std::string captures_page(std::span<const CaptureTrial> trials, const BenchOptions& options, const Machine& machine) {
  std::ostringstream out;
  out << "# Edits of captures whose right result is known\n\nMade by\n\n    build/release/splatdrag bench-edit "
         "--captures";
  for (const std::string& name : options.cases) out << " --case " << name;
  out << " --preset " << proto::name_of(options.preset);
  for (const std::string& corrector : options.correctors) out << " --corrector " << corrector;
  if (options.captures.by != CaptureOptions{}.by)
    for (const std::string& by : options.captures.by) out << " --by " << by;
  if (options.captures.fit_iterations != CaptureOptions{}.fit_iterations)
    out << " --fit-iterations " << options.captures.fit_iterations;
  if (options.captures.take != CaptureOptions{}.take) out << " --take " << options.captures.take;
  out << " --out out/captures --page " << (options.captures.page.empty() ? "docs/captures.md" : options.captures.page)
      << "\n\non " << machine.threads << " threads, " << machine.simd
      << ". Trained scenes are kept (`--cache`): the first run takes longer.\n\n"
      << how << engine::captures::capture_table_head();
  double fits = 0;
  for (const CaptureTrial& trial : trials) {
    out << engine::captures::capture_table_row(trial);
    fits += trial.fit_seconds / double(2 * trials.size());
  }
  out << "\nA fit of " << options.captures.fit_iterations << " iterations took " << std::fixed << std::setprecision(0)
      << fits << " s on average, on a machine that did other work, too.\n\n## Means\n\n"
      << means(trials, options) << "\n## Cases\n\n"
      << cases(trials);
  return out.str();
}

}  // namespace server::cli
