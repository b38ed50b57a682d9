#include "server/edits/selections.h"

#include <thread>

#include "tests/engine/jobs/jobs_support.h"
#include "tests/server/scenes/store_support.h"

namespace server::edits {
namespace {

namespace on_wire = proto::selection;
using engine::ErrorCode;
using engine::jobs::value;

struct SelectionsTest : scenes::StoreFixture {
  std::string id = add(50);
  std::chrono::steady_clock::time_point time{};

  [[nodiscard]] SelectionsOptions small() {
    SelectionsOptions chosen;
    chosen.max_made = 3;
    chosen.clock = [this] { return time; };
    return chosen;
  }
  scenes::LoadedVersion version(const std::string& number = "0") { return value(store->load(id, number)); }
  static proto::Selection rows(std::uint64_t from, std::uint64_t to) {
    return {{.action = on_wire::Rows{{{from, to}}}}};
  }
};

TEST_F(SelectionsTest, GiveTheSameIdForTheSameOperationsOnTheSameGaussians) {
  Selections selections(*store, small());
  const auto first = value(selections.make(version(), rows(3, 7)));
  EXPECT_EQ(first->selected.count, 4u);
  EXPECT_EQ(value(selections.make(version(), rows(3, 7))), first) << "nothing is done twice";
  EXPECT_EQ(value(selections.find(version(), first->id)), first);
  EXPECT_NE(value(selections.make(version(), rows(3, 8)))->id, first->id);
  Selections others(*store);
  EXPECT_EQ(value(others.make(version(), rows(3, 7)))->id, first->id);
  const auto unknown = others.find(version(), "q1");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::not_found);
  EXPECT_EQ(unknown.error().where, "selection");
}

TEST_F(SelectionsTest, BelongToTheirVersion) {
  Selections selections(*store, small());
  ASSERT_TRUE(add_version(*store, id, 0, "e1", scenes::small_edit(cloud_of(id, "0"))));
  const auto before = value(selections.make(version("0"), rows(0, 2)));
  const auto after = value(selections.make(version("1"), rows(0, 2)));
  EXPECT_NE(before->id, after->id);
  EXPECT_FALSE(selections.find(version("1"), before->id));
  const auto merged = cloud_of(id, "1");
  EXPECT_EQ(after->selected.rows.size(), merged.size());
  EXPECT_EQ(after->selected.bounds.low, glm::min(merged.mean.get(0), merged.mean.get(1))) << "rows of what is shown";
  EXPECT_FALSE(selections.make(version("1"), rows(0, 51))) << "it has 50";
}

TEST_F(SelectionsTest, AreForgottenWhenOthersComeOrTimeGoesBy) {
  Selections selections(*store, small());
  std::vector<std::string> ids;
  for (std::uint64_t i = 0; i < 3; ++i) ids.push_back(value(selections.make(version(), rows(i, i + 1)))->id);
  EXPECT_TRUE(selections.find(version(), ids[0])) << "and is now the one asked for last";
  ids.push_back(value(selections.make(version(), rows(9, 10)))->id);
  EXPECT_TRUE(selections.find(version(), ids[0]));
  EXPECT_FALSE(selections.find(version(), ids[1]));
  time += std::chrono::minutes(11);
  (void)value(selections.make(version(), rows(20, 21)));
  EXPECT_FALSE(selections.find(version(), ids[0]));
}

TEST_F(SelectionsTest, GrowTheSameWhetherOneHasGrownThereBeforeOrNot) {
  const auto cloud = cloud_of(id, "0");
  const auto grow = [&](std::size_t row) {
    const auto at = cloud.mean.get(row);
    return proto::Selection{{.action = on_wire::Grow{{{at.x, at.y, at.z}}, {}, 2.0}}};
  };
  Selections selections(*store, small());
  (void)value(selections.make(version(), grow(0)));
  const auto second = value(selections.make(version(), grow(1)));
  Selections fresh(*store);
  EXPECT_EQ(value(fresh.make(version(), grow(1)))->selected.rows, second->selected.rows);
}

TEST_F(SelectionsTest, HoldNoSceneInMemory) {
  Selections selections(*store, small());
  (void)value(selections.make(version(), rows(0, 1)));
  EXPECT_EQ(version().cloud.base.use_count(), 2) << "the store's, and this one";
  ASSERT_TRUE(store->remove(id));
  id = add(60, 2);
  EXPECT_EQ(value(selections.make(version(), rows(0, 60)))->selected.count, 60u) << "and use none that is gone";
}

TEST_F(SelectionsTest, MayBeMadeByManyAtATime) {
  Selections selections(*store, small());
  const auto here = version();
  std::vector<std::thread> threads;
  for (std::uint64_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (std::uint64_t i = 0; i < 20; ++i) {
        const auto made = selections.make(here, rows(t, t + 1 + i % 5));
        EXPECT_EQ(made ? (*made)->selected.count : 0u, 1 + i % 5);
      }
    });
  for (std::thread& thread : threads) thread.join();
}

TEST_F(SelectionsTest, LookThroughTheDatasetsViews) {
  Selections selections(*store, small());
  const proto::Selection stroke{{.action = on_wire::Stroke{"images/a.png", {{32, 24}}, 20}}};
  const auto without = selections.resolve(id, stroke);
  ASSERT_FALSE(without);
  EXPECT_EQ(without.error().where, "selection[0].stroke.view");
  std::filesystem::create_directories(options.scene_root / "views");
  support::write_file(options.scene_root / "views/transforms.json", scenes::transforms_json());
  ASSERT_TRUE(store->put_dataset_path(id, "views"));
  const auto resolved = selections.resolve(id, stroke);
  ASSERT_TRUE(resolved) << resolved.error().message;
  EXPECT_TRUE(std::holds_alternative<proto::Camera>(std::get<on_wire::Stroke>(resolved->at(0).action).viewpoint));
  EXPECT_EQ(value(selections.cameras_about(id, *resolved)).size(), 2u);
  EXPECT_TRUE(selections.make(version(), *resolved));
}

TEST_F(SelectionsTest, TellHowMuchOfAViewIsSelected) {
  Selections selections(*store, small());
  const auto camera = engine::scene::look_at({0, 0, -8}, {0, 0, 0}, {0, -1, 0}, 0.8, 32, 24);
  const auto share = [&](const proto::Selection& selection) {
    return selections.shown_shares(version(), *value(selections.make(version(), selection)), {camera}).at(0);
  };
  EXPECT_EQ(share({}), 0);
  EXPECT_NEAR(share({{.action = on_wire::Invert{}}}), 1, 1e-6);
}

}  // namespace
}  // namespace server::edits
