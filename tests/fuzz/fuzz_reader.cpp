#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#ifdef TROCHOID_HAS_TRACKING
#include "trochoid/tracking/frame_source.hpp"
#endif

// One executable per reader (FUZZ_READER, tests/fuzz/CMakeLists.txt): whatever the bytes, it reads
// or refuses with a one-line InputError. What it read must survive being written and read again.
namespace trochoid {
namespace {

/// A file in memory with a path.
class MemoryFile {
 public:
  MemoryFile(const std::uint8_t* bytes, std::size_t size) : handle_(memfd_create("fuzz", 0)) {
    for (std::size_t done = 0; done < size;) {
      const ssize_t n = write(handle_, bytes + done, size - done);
      if (n <= 0) __builtin_trap();
      done += static_cast<std::size_t>(n);
    }
  }
  ~MemoryFile() { close(handle_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(handle_); }

 private:
  int handle_;
};

[[maybe_unused]] void track(const std::string& path) {
  (void)data::read_track(path);
}
[[maybe_unused]] void scene(const std::string& path) {
  const std::string once = data::to_toml(data::read_scene(path));
  if (data::to_toml(data::parse_scene(once, "again")) != once) __builtin_trap();
}
[[maybe_unused]] void fit(const std::string& path) {
  (void)data::read_fit(path);
}
[[maybe_unused]] void camera(const std::string& path) {
  (void)data::read_camera(path);
}
[[maybe_unused]] void object(const std::string& path) {
  (void)data::read_object(path);
}
[[maybe_unused]] void table(const std::string& path) {
  (void)data::read_table(path);
}
[[maybe_unused]] void reference(const std::string& path) {
  (void)data::read_reference_case(path);
}
#ifdef TROCHOID_HAS_TRACKING
[[maybe_unused]] void video(const std::string& path) {
  constexpr int kEnough = 8;  // frames: what follows is read by the same lines
  const auto source = tracking::open_video(path, {.decoder_threads = 1, .chroma = true});
  for (int i = 0; i < kEnough && source->next(); ++i) {
  }
}
#endif

}  // namespace
}  // namespace trochoid

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const trochoid::MemoryFile file(bytes, size);
  try {
    trochoid::FUZZ_READER(file.path());
  } catch (const trochoid::InputError& refusal) {
    if (std::string(refusal.what()).find('\n') != std::string::npos) __builtin_trap();
  }
  return 0;
}
