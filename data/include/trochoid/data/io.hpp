#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/data/track.hpp"

/// Readers throw InputError with file, line or key, value and remedy. Writers write whole files or
/// nothing: to a temporary neighbour first, then renamed. Formats: docs/formats.md.
namespace trochoid::data {

[[nodiscard]] TrackFile read_track(const std::filesystem::path& path);
void write_track(const TrackFile& file, const std::filesystem::path& path);

[[nodiscard]] Scene read_scene(const std::filesystem::path& path);
/// Parses TOML text; `where` stands for the file in messages.
/// @throws SceneError (scene_error.hpp) where a line is wrong.
[[nodiscard]] Scene parse_scene(const std::string& toml, const std::string& where);
[[nodiscard]] std::string to_toml(const Scene& scene);

[[nodiscard]] Fit read_fit(const std::filesystem::path& path);
/// A fit from the text of its file, and back; the text ends in a newline.
/// @param where names it in errors.
[[nodiscard]] Fit parse_fit(const std::string& text, const std::string& where);
[[nodiscard]] std::string fit_text(const Fit& fit, const std::string& where);
void write_fit(const Fit& fit, const std::filesystem::path& path);

[[nodiscard]] Camera read_camera(const std::filesystem::path& path);
/// The camera of a scene's recordings: its file's, else one above the floor of this picture size
/// with its scale, perspective if its height is given too; nothing without a scale.
/// @throws InputError if the file cannot be read.
[[nodiscard]] std::optional<Camera> camera_of(const Scene& scene, int width_px, int height_px);
void write_camera(const Camera& camera, const std::filesystem::path& path);

/// Body and support of a recording's object.json (see docs/formats.md). Never the law, its
/// parameters, the start, or the distance from pivot to CoM: those are for the fit to find.
[[nodiscard]] Scene read_object(const std::filesystem::path& path);

[[nodiscard]] Table read_table(const std::filesystem::path& path);
void write_table(const Table& table, const std::filesystem::path& path);

/// A file's text, refused beyond `limit_bytes` (an endless device, a video given as a table). Lines
/// that end in \r alone throughout end in \n.
/// @throws InputError naming the file if it is missing, a folder, unreadable (also part of it) or
/// too large.
[[nodiscard]] std::string read_text(const std::filesystem::path& path,
                                    std::size_t limit_bytes = std::size_t{64} << 20);
/// Writes `text` whole or not at all. @throws InputError if the folder cannot be written.
void write_text(const std::string& text, const std::filesystem::path& path);
/// Hex SHA-256 of a file's bytes. @throws InputError naming the file if not all of it can be read.
[[nodiscard]] std::string sha256_of_file(const std::filesystem::path& path);
[[nodiscard]] std::string sha256_of_text(const std::string& text);

/// A name beside `target`, hidden and this process' own, for a file or folder that is to become it.
/// What killed processes left beside the same target is swept away. Ends in exactly one of
/// discard_pending() and rename_pending(), the latter only when it returns no error.
[[nodiscard]] std::filesystem::path pending_neighbour(const std::filesystem::path& target);
void discard_pending(const std::filesystem::path& path) noexcept;
/// A folder takes the place of an existing one in one step (where the file system can exchange).
[[nodiscard]] std::error_code rename_pending(const std::filesystem::path& path,
                                             const std::filesystem::path& target);
/// Removes whatever this process has pending and lets nothing become its target any more: for a
/// program that is about to end by a signal. Any other use of pending files waits for ever after.
void remove_pending_and_stop();

/// Whether a file could be written here: in a folder that exists and lets it, over nothing that is
/// write-protected. Changes nothing. @throws InputError naming the target and what stands in the
/// way.
void check_writable(const std::filesystem::path& target);

/// A temporary file beside `target` that becomes `target` on commit() and vanishes otherwise; for
/// writers that need a path (video encoders).
class PendingFile {
 public:
  explicit PendingFile(std::filesystem::path target);
  ~PendingFile();
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return temporary_; }
  void commit();

 private:
  std::filesystem::path target_, temporary_;
};

}  // namespace trochoid::data
