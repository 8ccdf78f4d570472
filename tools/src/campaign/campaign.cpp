#include "campaign/campaign.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/child_process.hpp"
#include "common/json_object.hpp"
#include "common/recording_name.hpp"
#include "report/run_folder.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

fs::path record_path(const Campaign& campaign, const CampaignItem& item) {
  return campaign.folder / "records" / (item.name + ".json");
}
fs::path folder_of(const Campaign& campaign, const std::string& name) {
  return campaign.folder / (name + ".trochoid");
}

std::vector<fs::path> inputs_of(const CampaignItem& item) {
  std::vector<fs::path> inputs{item.video};
  for (const fs::path& file : {item.scene, item.camera})
    if (!file.empty()) inputs.push_back(file);
  try {
    const std::string camera = item.scene.empty() ? "" : data::read_scene(item.scene).camera.file;
    if (!camera.empty() && item.camera.empty()) inputs.emplace_back(camera);
  } catch (const InputError&) {  // the run will say what is wrong with the scene
  }
  return inputs;
}

std::vector<std::string> command_of(const Campaign& campaign, const CampaignItem& item) {
  std::vector<std::string> command{"trochoid",
                                   "-q",
                                   "run",
                                   item.video.string(),
                                   "--json",
                                   "-o",
                                   folder_of(campaign, item.name).string()};
  if (!item.scene.empty()) command.insert(command.end(), {"--scene", item.scene.string()});
  if (!item.camera.empty()) command.insert(command.end(), {"--camera", item.camera.string()});
  command.insert(command.end(), item.options.begin(), item.options.end());
  return command;
}

/// Size and time of a file; " missing" for one that is not there.
std::string state_of(const fs::path& file) {
  std::error_code code;
  const auto size = fs::file_size(file, code);
  const auto time = code ? fs::file_time_type() : fs::last_write_time(file, code);
  return code ? " missing" : fmt::format(" {}@{}", size, time.time_since_epoch().count());
}

/// Of a video its file's; of pictures, what all of theirs come to.
std::string state_of_recording(const fs::path& recording) {
  try {
    const std::vector<fs::path> files = tracking::files_of_recording(recording);
    if (files.front() == recording) return state_of(recording);
    std::string all;
    for (const fs::path& file : files) all += file.filename().string() + state_of(file) + "\n";
    return " " + data::sha256_of_text(all);
  } catch (const InputError&) {  // the run will say what is wrong with it
    return " missing";
  }
}

/// Size and time stand for the content: reading a thousand recordings again to see that nothing has
/// changed would take as long as copying them.
std::string key_of(const Campaign& campaign, const CampaignItem& item) {
  std::string key =
      fmt::format("{} {}", TROCHOID_VERSION, fmt::join(command_of(campaign, item), " "));
  for (const fs::path& file : inputs_of(item))
    key += file == item.video ? state_of_recording(file) : state_of(file);
  return as_utf8(key);  // as the record will hold it
}

Json json_of(const CampaignRecord& record) {
  Json inputs = Json::object();
  for (const auto& [file, sha256] : record.inputs) inputs[file] = sha256;
  return {
      {"name", record.name},       {"done", record.done},       {"exit_status", record.exit_status},
      {"message", record.message}, {"grade", record.grade},     {"verdict", record.verdict},
      {"seconds", record.seconds}, {"peak_mb", record.peak_mb}, {"version", record.version},
      {"command", record.command}, {"inputs", inputs},          {"key", record.key}};
}

CampaignRecord record_of(const Json& json) {
  CampaignRecord record;
  json.at("name").get_to(record.name);
  json.at("done").get_to(record.done);
  json.at("exit_status").get_to(record.exit_status);
  json.at("message").get_to(record.message);
  json.at("grade").get_to(record.grade);
  json.at("verdict").get_to(record.verdict);
  json.at("seconds").get_to(record.seconds);
  json.at("peak_mb").get_to(record.peak_mb);
  json.at("version").get_to(record.version);
  json.at("command").get_to(record.command);
  json.at("key").get_to(record.key);
  for (const auto& [file, sha256] : json.at("inputs").items())
    record.inputs.emplace_back(file, sha256.get<std::string>());
  return record;
}

void read_answer(const fs::path& file, CampaignRecord& record) {
  const auto answer = read_json_object(file);
  if (!answer) return;
  record.grade = answer->value("grade", "");
  record.verdict = answer->value("verdict", "");
}

// Also of a run that failed: they tell whether its cause was mended. Empty for what cannot be read.
std::vector<std::pair<std::string, std::string>> checksums(const CampaignItem& item) {
  std::vector<std::pair<std::string, std::string>> sums;
  for (const fs::path& file : inputs_of(item)) {
    sums.emplace_back(file.string(), "");
    try {
      sums.back().second = tracking::sha256_of_recording(file);
    } catch (const InputError&) {  // the run has said so
    }
  }
  return sums;
}

}  // namespace

void check_items(const Campaign& campaign, const std::vector<const CampaignItem*>& items,
                 const std::function<void(const std::vector<std::string>& words)>& check_run) {
  std::string first;
  int wrong = 0;
  for (const CampaignItem* item : items) try {
      std::vector<std::string> words = command_of(campaign, *item);
      words.erase(words.begin(), std::find(words.begin(), words.end(), "run") + 1);
      check_run(words);
    } catch (const InputError& error) {
      if (wrong++ == 0) first = fmt::format("{}: {}", item->declared, error.what());
    }
  if (wrong > 1)
    first += fmt::format(" ({} more recording{} cannot be run either)", wrong - 1,
                         wrong == 2 ? "" : "s");
  if (wrong > 0) throw InputError(first);
}

namespace {

fs::path fit_of(const Campaign& campaign, const CampaignItem& item) {
  return folder_of(campaign, item.name) / (recording_name(item.video) + ".fit.json");
}

// Whether what the run left is there still: its report, and its fit unless it had none.
bool holds_answer(const Campaign& campaign, const CampaignItem& item) {
  const fs::path folder = folder_of(campaign, item.name);
  const auto run = read_json_object(folder / kRunFile);
  if (!run || !fs::exists(folder / "report.html")) return false;
  if (run->value("no_fit_reason", "") != "") return true;
  try {
    (void)data::read_fit(fit_of(campaign, item));
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

std::optional<CampaignRecord> current_record(const Campaign& campaign, const CampaignItem& item) {
  const auto json = read_json_object(record_path(campaign, item));
  if (!json) return std::nullopt;
  try {
    CampaignRecord record = record_of(*json);
    if (record.key == key_of(campaign, item) && (!record.done || holds_answer(campaign, item)))
      return record;
  } catch (const Json::exception&) {  // not ours, or an older version's: as if never run
  }
  return std::nullopt;
}

CampaignRecord run_item(const Campaign& campaign, const CampaignItem& item) {
  CampaignRecord record;
  record.name = item.name;
  record.version = TROCHOID_VERSION;
  record.command = command_of(campaign, item);
  record.key = key_of(campaign, item);
  std::vector<std::string> arguments = record.command;
  arguments.front() = own_path();
  data::PendingFile answer(record_path(campaign, item));
  const ChildRun run = run_child(arguments, answer.path());
  record.exit_status = run.exit_status;
  record.seconds = run.seconds;
  record.peak_mb = run.peak_mb;
  record.done = run.exit_status == 0 || run.exit_status == 3;
  record.inputs = checksums(item);
  if (record.done) read_answer(answer.path(), record);
  if (record.exit_status != 0 && record.message.empty())
    record.message = last_line(run.error_output);
  data::write_text(json_text(json_of(record)) + "\n", record_path(campaign, item));
  return record;
}

std::vector<CampaignLine> collect(const Campaign& campaign) {
  std::vector<CampaignLine> lines;
  for (const CampaignItem& item : campaign.items) {
    CampaignLine line;
    if (auto record = current_record(campaign, item)) {
      line.record = std::move(*record);
      line.known = true;
    }
    line.record.name = item.name;  // as its folder has it, be it UTF-8 or not
    if (line.record.done) {
      if (const auto run = read_json_object(folder_of(campaign, item.name) / kRunFile)) {
        line.frames = run->value("frames", std::int64_t{0});
        line.found = run->value("found", std::int64_t{0});
      }
      const fs::path fit = fit_of(campaign, item);
      if (std::error_code code; fs::exists(fit, code)) line.fit = data::read_fit(fit);
    }
    lines.push_back(std::move(line));
  }
  return lines;
}

}  // namespace trochoid::tools
