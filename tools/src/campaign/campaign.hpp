#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/data/fit.hpp"

namespace trochoid::tools {

/// One recording of a campaign and what `trochoid run` is to be told about it.
struct CampaignItem {
  std::string name;  ///< of its folder and record; unique
  std::filesystem::path video, scene, camera;
  std::vector<std::string> options;  ///< further words of the command line
  std::string declared;              ///< where in the manifest, "lab.toml:5"
};

struct Campaign {
  std::filesystem::path manifest, folder;
  std::vector<CampaignItem> items;  ///< in the manifest's order, patterns expanded and sorted
};

/// Reads a manifest (docs/campaigns.md); relative paths start at its folder.
/// @throws InputError naming file and key, or a pattern that matches nothing.
[[nodiscard]] Campaign read_campaign(const std::filesystem::path& manifest);

/// Before any is run: every one must have its files, a scene that can be read, and options that
/// `trochoid run` takes. What only the recording itself tells stays with its own run.
/// @param check_run  given the words after `trochoid run`, throws InputError where that would.
/// @throws InputError naming the first that cannot be run, and how many more there are.
void check_items(const Campaign& campaign, const std::vector<const CampaignItem*>& items,
                 const std::function<void(const std::vector<std::string>& words)>& check_run);

/// What is known of an item after it was run; survives as records/NAME.json.
struct CampaignRecord {
  std::string name;
  bool done = false;     ///< it was run to an answer
  int exit_status = -1;  ///< of trochoid run; 0 good, 3 not good
  std::string message;   ///< why it failed
  std::string grade, verdict;
  double seconds = 0.0, peak_mb = 0.0;
  std::string version;
  std::vector<std::string> command;
  std::vector<std::pair<std::string, std::string>> inputs;  ///< file and sha256
  std::string key;  ///< version, command, and size and time of every input: same key, same answer
};

/// The record of an item; nothing if it was never run, or not as the manifest now says.
[[nodiscard]] std::optional<CampaignRecord> current_record(const Campaign& campaign,
                                                           const CampaignItem& item);

/// Runs one item in a process of its own and writes its record; never throws for what the item
/// does.
CampaignRecord run_item(const Campaign& campaign, const CampaignItem& item);

/// A line of the summary: the record and what the run's folder holds.
struct CampaignLine {
  CampaignRecord record;
  bool known = false;  ///< there is a current record
  std::optional<data::Fit> fit;
  std::int64_t frames = 0, found = 0;
};
[[nodiscard]] std::vector<CampaignLine> collect(const Campaign& campaign);

/// Table of all items (CSV), one line each, and the same for reading (HTML): counts, failures with
/// reasons, parameters over all items of a model, links to each report.
[[nodiscard]] std::string summary_csv(const std::vector<CampaignLine>& lines);
[[nodiscard]] std::string summary_html(const Campaign& campaign,
                                       const std::vector<CampaignLine>& lines);

}  // namespace trochoid::tools
