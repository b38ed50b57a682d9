#include "server/cli/bench_captures.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "engine/captures/captured_case.h"
#include "server/cli/bench_edit.h"
#include "server/cli/captures_page.h"
#include "server/cli/program.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

using engine::captures::CaptureTrial;

/// An environment variable that has another value, or none, until the end of the scope.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* const before = std::getenv(name)) before_ = before;
    set(value);
  }
  ~Variable() { set(before_ ? before_->c_str() : nullptr); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  void set(const char* value) {
    if (value != nullptr)
      setenv(name_, value, 1);
    else
      unsetenv(name_);
  }
  const char* name_;
  std::optional<std::string> before_;
};

TEST(DefaultCaptureCache, IsTheUsersOwn) {
  const Variable home("HOME", "/home/somebody");
  {
    const Variable cache("XDG_CACHE_HOME", "/fast");
    EXPECT_EQ(default_capture_cache().value(), "/fast/splatdrag/captures");
  }
  for (const char* value : {"", "relative", static_cast<const char*>(nullptr)}) {
    const Variable cache("XDG_CACHE_HOME", value);
    EXPECT_EQ(default_capture_cache().value(), "/home/somebody/.cache/splatdrag/captures");
  }
}

TEST(DefaultCaptureCache, IsAskedForWhereTheEnvironmentSaysNothing) {
  const Variable home("HOME", nullptr), cache("XDG_CACHE_HOME", nullptr);
  const auto folder = default_capture_cache();
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().where, "--cache");
}

CaptureTrial trial_of(const std::string& name, bool is_test, double deformed, double edited) {
  CaptureTrial trial;
  trial.trial.name = name, trial.trial.what = "Something " + name + ".", trial.trial.corrector = "scene";
  trial.trial.untouched.edited = {10, 0.5, 9};
  trial.deformed.edited = {deformed, 0.5, 9};
  trial.trial.result.edited = {edited, 0.5, 9};
  trial.ceiling.edited = {30, 0.5, 9};
  trial.is_test = is_test;
  trial.by = "balls";
  return trial;
}

TEST(CapturesPage, TellsTheSetsApartAndNamesWhatIsMissing) {
  BenchOptions options;
  options.cases = {"mug", "turn", "lid"};
  std::vector<CaptureTrial> trials{trial_of("mug", false, 20, 21), trial_of("turn", false, 20, 23),
                                   trial_of("lid", true, 15, 14), trial_of("mug", false, 24, 28)};
  trials.back().by = "clicks";
  const std::string page = captures_page(trials, options, {.threads = 2, .simd = "AVX2"});
  EXPECT_NE(page.find("bench-edit --captures --case mug --case turn --case lid --preset draft --corrector scene"),
            std::string::npos)
      << page;
  EXPECT_NE(page.find("| choose | balls | scene | 2 | 20.00 | 22.00 | 2.00 | 1.00 | 30.00 | 60 |"), std::string::npos)
      << page;
  EXPECT_NE(page.find("| test | balls | scene | 1 | 15.00 | 14.00 | -1.00 | -1.00 | 30.00 | 20 |"), std::string::npos)
      << page;
  EXPECT_NE(page.find("| choose | clicks | scene | 1 | 24.00 | 28.00 | 4.00 | 4.00 | 30.00 | 90 |"), std::string::npos)
      << page;
  EXPECT_NE(page.find("- `lid` (test): Something lid."), std::string::npos) << page;
  const std::size_t missing = page.find("Not carried out for this page: ");
  ASSERT_NE(missing, std::string::npos) << page;
  EXPECT_NE(page.find("`rod`", missing), std::string::npos);
  EXPECT_EQ(page.find("`mug`", missing), std::string::npos);
  EXPECT_EQ(page.find("--take"), page.rfind("--take")) << "only what it says of the sets";
}

TEST(CapturesPage, OfAnotherTakeSaysWhich) {
  BenchOptions options;
  options.captures.take = 3;
  EXPECT_NE(captures_page({}, options, {}).find(" --take 3 --out"), std::string::npos);
}

TEST(CapturesPage, OfAllCasesMissesNone) {
  std::vector<CaptureTrial> trials;
  for (const std::string& name : engine::captures::captured_case_names()) trials.push_back(trial_of(name, false, 1, 2));
  EXPECT_EQ(captures_page(trials, {}, {}).find("Not carried out"), std::string::npos);
}

}  // namespace
}  // namespace server::cli
