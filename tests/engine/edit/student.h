// A repainter for tests: it notes what it is asked, and what it paints depends on all that it has learned.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/correct/repainter.h"

namespace engine::edit {

class Student final : public correct::Repainter {
 public:
  struct Lesson {
    std::vector<correct::HistoryPicture> history;
    int steps = 0;
    std::uint64_t seed = 0;
  };
  struct Asked {
    std::vector<correct::RepaintTask> tasks;
    double strength = 0;
    std::uint64_t seed = 0;
  };
  std::vector<Lesson> lessons;
  std::vector<Asked> asked;
  /// Instead of what it would answer.
  std::function<Result<std::vector<scene::Image>>(std::span<const correct::RepaintTask>)> answer = {};

  Result<void> fine_tune(std::span<const correct::HistoryPicture> history, int steps, std::uint64_t seed,
                         const correct::Advance& advance) override {
    lessons.push_back({{history.begin(), history.end()}, steps, seed});
    for (int step = 0; step < steps; ++step)
      if (auto going = advance(double(step) / steps); !going) return going;
    ByteWriter out;
    out.write(learned_), out.write(seed), out.write(std::int32_t(steps));
    for (const correct::HistoryPicture& picture : history) {
      for (const int value : {int(picture.view), picture.interval, picture.box.x0, picture.box.y1})
        out.write(std::int32_t(value));
      out.write_all(std::span(picture.picture.data));
    }
    learned_ = fnv1a(out.bytes());
    return {};
  }

  /// Every task in one colour, which its seed and all lessons so far decide.
  Result<std::vector<scene::Image>> repaint(std::span<const correct::RepaintTask> tasks, double strength,
                                            std::uint64_t seed, const correct::Advance& advance) override {
    asked.push_back({{tasks.begin(), tasks.end()}, strength, seed});
    if (answer) return answer(tasks);
    std::vector<scene::Image> out;
    for (const correct::RepaintTask& task : tasks) {
      if (auto going = advance(double(out.size()) / double(tasks.size())); !going) return propagate(going);
      scene::Image& picture = out.emplace_back(task.picture.width, task.picture.height, 3);
      for (int c = 0; c < 3; ++c)
        for (float& value : picture.plane(c)) value = float((learned_ ^ seed) >> 8 * c & 0xff) / 255;
    }
    return out;
  }

  std::string state() const override {
    ByteWriter out;
    out.write(learned_);
    return std::move(out).take();
  }
  Result<void> restore(std::string_view state) override {
    ByteReader in(std::as_bytes(std::span(state)));
    learned_ = in.read<std::uint64_t>();
    if (!in.ok() || in.remaining() != 0) return fail(ErrorCode::corrupt_data, "not what was learned", "checkpoint");
    return {};
  }

 private:
  std::uint64_t learned_ = 0;
};

}  // namespace engine::edit
