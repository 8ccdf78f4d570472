#pragma once
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>

namespace trochoid::tools {

/// What the program says on stderr while it works; set once from --quiet and --verbose.
enum class Talk { quiet, normal, verbose };
void set_talk(Talk talk);
[[nodiscard]] Talk talk();

/// One line on stderr: "what 120/300 frames, 85 frames/s, 2 s left". Drawn only on a terminal, only
/// once the work has lasted a second, at most ten times a second; wiped when the object dies, so
/// that results follow on a clean line. Silent with --quiet. May be called from several threads.
class Progress {
 public:
  /// @param what  the stage, e.g. "track".  @param unit  plural of what is counted, e.g. "frames".
  explicit Progress(std::string what, std::string unit = "frames");
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` units; total <= 0: unknown, then only the count and the rate are shown.
  void update(std::int64_t done, std::int64_t total);
  /// For work in stages of changing name of which nobody knows how many there will be (a fit).
  void update(const std::string& stage);

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] bool due();
  void draw(const std::string& line);

  std::string what_, unit_;
  bool enabled_;
  bool drawn_ = false;
  Clock::time_point start_, last_;
  std::mutex mutex_;
};

/// A line on stderr: note() unless --quiet, detail() only with --verbose.
void note(const std::string& line);
void detail(const std::string& line);

/// "2 s", "3 min 20 s", "1 h 5 min": what a person wants to know of a remaining time.
[[nodiscard]] std::string duration_words(double seconds);

}  // namespace trochoid::tools
