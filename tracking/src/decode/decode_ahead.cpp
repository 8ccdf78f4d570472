#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {
namespace {

/// Runs another source in a thread of its own; at most `length` frames wait. An exception of the
/// source comes out of next() where its frame would have come.
class AheadSource final : public FrameSource {
 public:
  AheadSource(std::unique_ptr<FrameSource> source, std::size_t length)
      : source_(std::move(source)), length_(length), worker_([this] { work(); }) {}

  ~AheadSource() override {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    space_.notify_all();
    worker_.join();
  }

  [[nodiscard]] const VideoInfo& info() const override { return source_->info(); }

  [[nodiscard]] std::optional<Frame> next() override {
    std::unique_lock lock(mutex_);
    ready_.wait(lock, [this] { return !queue_.empty() || done_; });
    if (queue_.empty()) {
      if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
      return std::nullopt;
    }
    Frame frame = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();
    space_.notify_one();
    return frame;
  }

 private:
  void work() {
    std::exception_ptr error;
    try {
      while (auto frame = source_->next())
        if (!push(std::move(*frame))) break;
    } catch (...) {
      error = std::current_exception();
    }
    {
      const std::lock_guard lock(mutex_);
      error_ = error;
      done_ = true;
    }
    ready_.notify_all();
  }

  /// False when nobody wants more frames.
  bool push(Frame frame) {
    std::unique_lock lock(mutex_);
    space_.wait(lock, [this] { return queue_.size() < length_ || stop_; });
    if (stop_) return false;
    queue_.push_back(std::move(frame));
    lock.unlock();
    ready_.notify_one();
    return true;
  }

  std::unique_ptr<FrameSource> source_;
  std::size_t length_;
  std::mutex mutex_;
  std::condition_variable ready_, space_;
  std::deque<Frame> queue_;
  std::exception_ptr error_;
  bool done_ = false, stop_ = false;
  std::thread worker_;  // last: starts when everything else exists
};

}  // namespace

std::unique_ptr<FrameSource> decode_ahead(std::unique_ptr<FrameSource> source, int queue_length) {
  return std::make_unique<AheadSource>(std::move(source),
                                       static_cast<std::size_t>(std::max(1, queue_length)));
}

}  // namespace trochoid::tracking
