#include "common/progress.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trochoid::tools {
namespace {

Talk current_talk = Talk::normal;

using namespace std::chrono_literals;
constexpr auto kFirstAfter = 1s;       // shorter work needs no bar
constexpr auto kRedrawEvery = 100ms;   // faster flickers
constexpr double kBelievable = 0.005;  // below this fraction the time left is noise

std::string time_left_words(double elapsed_s, double fraction) {
  if (!(fraction > kBelievable)) return {};
  return ", " + duration_words(elapsed_s * (1.0 - fraction) / fraction) + " left";
}

/// Work goes on where nobody can read what is said of it: stderr may be closed or full.
void say(const std::string& words) {
  std::fputs(words.c_str(), stderr);
}

}  // namespace

void set_talk(Talk talk) {
  current_talk = talk;
}
Talk talk() {
  return current_talk;
}

void note(const std::string& line) {
  if (current_talk != Talk::quiet) say(line + "\n");
}

void detail(const std::string& line) {
  if (current_talk == Talk::verbose) say(line + "\n");
}

std::string duration_words(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::ceil(std::max(0.0, seconds)));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole / 60 % 60);
}

Progress::Progress(std::string what, std::string unit)
    : what_(std::move(what)),
      unit_(std::move(unit)),
      enabled_(current_talk != Talk::quiet && isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      last_(start_) {}

Progress::~Progress() {
  if (drawn_) say("\r\033[K");
}

bool Progress::due() {
  const auto now = Clock::now();
  if (now - start_ < kFirstAfter || now - last_ < kRedrawEvery) return false;
  last_ = now;
  return true;
}

void Progress::draw(const std::string& line) {
  drawn_ = true;
  say("\r\033[K" + line);
  std::fflush(stderr);
}

void Progress::update(std::int64_t done, std::int64_t total) {
  if (!enabled_) return;
  const std::lock_guard lock(mutex_);
  if (!due()) return;
  const double elapsed_s = std::chrono::duration<double>(last_ - start_).count();
  const double rate = static_cast<double>(done) / elapsed_s;
  if (total > 0) {
    const double fraction = static_cast<double>(done) / static_cast<double>(total);
    draw(fmt::format("{}: {}/{} {}, {:.3g} {}/s{}", what_, done, total, unit_, rate, unit_,
                     time_left_words(elapsed_s, fraction)));
  } else {
    draw(fmt::format("{}: {} {}, {:.3g} {}/s", what_, done, unit_, rate, unit_));
  }
}

void Progress::update(const std::string& stage) {
  if (!enabled_) return;
  const std::lock_guard lock(mutex_);
  if (!due()) return;
  const double elapsed_s = std::chrono::duration<double>(last_ - start_).count();
  draw(fmt::format("{}: {} ({})", what_, stage, duration_words(elapsed_s)));
}

}  // namespace trochoid::tools
