#include "server/http/workers.h"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <new>
#include <utility>

#include "server/http/places.h"

namespace server::http {
namespace {

using namespace std::chrono_literals;

struct WorkersTest : testing::Test {
  std::unique_ptr<Visit> visit() {
    return std::make_unique<Visit>(engine::FileDescriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)),
                                   ConnectionLimits{}, -1, places);
  }
  /// Workers whose threads do this, once `failures` of them could not be set up.
  std::unique_ptr<Workers> workers(int failures, Workers::Serve serve) {
    return std::make_unique<Workers>(
        WorkerLimits{},
        [serve = std::move(serve), failures]() mutable -> Workers::Serve {
          if (failures-- > 0) throw std::bad_alloc();
          return serve;
        },
        [this](std::unique_ptr<Visit> served) {
          const std::lock_guard lock(mutex);
          last = std::move(served);
          changed.notify_all();
        },
        [](int) {});
  }
  /// The visit that has been served; null: none within a minute.
  std::unique_ptr<Visit> served() {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, 1min, [this] { return last != nullptr; });
    return std::move(last);
  }

  Places places{[](int) {}};
  std::mutex mutex;
  std::condition_variable changed;
  std::unique_ptr<Visit> last;
};

TEST_F(WorkersTest, AThreadThatCannotBeSetUpIsAnsweredForByTheCaller) {
  for (const auto kind : {Workers::Kind::request, Workers::Kind::vital}) {
    const auto all = workers(1, [](Visit& visit) { visit.next = Next::say_goodbye; });
    auto first = visit(), second = visit();
    EXPECT_FALSE(all->offer(kind, first));
    EXPECT_TRUE(first) << "it stays the caller's";
    EXPECT_TRUE(all->offer(kind, second)) << "by now there is memory again";
    const auto done = served();
    ASSERT_TRUE(done);
    EXPECT_EQ(done->next, Next::say_goodbye);
  }
}

TEST_F(WorkersTest, AVisitThatIsNotServedToItsEndEndsAndItsThreadGoesOn) {
  int number = 0;
  const auto all = workers(0, [&number](Visit& visit) {
    if (++number == 1) throw std::bad_alloc();
    visit.next = Next::say_goodbye;
  });
  for (const auto next : {Next::end, Next::say_goodbye}) {
    auto offered = visit();
    ASSERT_TRUE(all->offer(Workers::Kind::request, offered));
    const auto done = served();
    ASSERT_TRUE(done);
    EXPECT_EQ(done->next, next);
  }
}

}  // namespace
}  // namespace server::http
