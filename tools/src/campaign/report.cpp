#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "campaign/campaign.hpp"
#include "common/fitted_scene.hpp"
#include "common/json_object.hpp"
#include "draw/svg.hpp"
#include "report/parts.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

bool failed(const CampaignLine& line) {
  return line.known && !line.record.done;
}

const char* status_of(const CampaignLine& line) {
  if (!line.known) return "not run";
  if (!line.record.done) return "failed";
  return line.record.exit_status == 0 ? "done" : "not good";
}

/// What was found of a recording, but for the starts of its later arcs.
bool is_found(const data::FitParameter& p) {
  return p.status != data::ParameterStatus::fixed && p.name.find('@') == std::string::npos;
}

/// Names of all such parameters of all fits, in the order they are met.
std::vector<std::string> parameter_names(const std::vector<CampaignLine>& lines) {
  std::vector<std::string> names;
  for (const CampaignLine& line : lines)
    if (line.fit)
      for (const data::FitParameter& p : line.fit->parameters)
        if (is_found(p) && std::find(names.begin(), names.end(), p.name) == names.end())
          names.push_back(p.name);
  return names;
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : c == '\n' ? " " : std::string(1, c);
  return quoted + "\"";
}

std::string csv_number(double value) {
  return std::isfinite(value) ? fmt::format("{:.10g}", value) : "";
}

/// All values of one parameter of one model.
struct Spread {
  std::string unit;
  std::vector<double> values, sigmas;
};

/// model -> parameter -> values, of the body and the table: no two throws start alike. Only of fits
/// that converged and saw the parameter.
std::map<std::string, std::map<std::string, Spread>> spreads(
    const std::vector<CampaignLine>& lines) {
  std::map<std::string, std::map<std::string, Spread>> all;
  for (const CampaignLine& line : lines) {
    if (!line.fit || !line.fit->converged) continue;
    for (const data::FitParameter& p : line.fit->parameters) {
      if (!is_found(p) || is_start(p) || !p.identifiable || !(p.sigma > 0.0) ||
          !std::isfinite(p.sigma))
        continue;
      Spread& spread = all[line.fit->model][p.name];
      spread.unit = p.unit;
      spread.values.push_back(p.value);
      spread.sigmas.push_back(p.sigma);
    }
  }
  return all;
}

std::string spread_table(const std::vector<CampaignLine>& lines) {
  const auto all = spreads(lines);
  if (all.empty()) return {};
  std::string html =
      "<h2>Parameters over all recordings</h2>\n<table><tr><th>model<th>parameter<th>fits<th>median"
      "<th>spread (half the middle 68 %)<th>median of the stated errors<th>unit</tr>\n";
  for (const auto& [model, parameters] : all)
    for (const auto& [name, spread] : parameters) {
      const double half_width =
          0.5 * (data::quantile(spread.values, 0.84) - data::quantile(spread.values, 0.16));
      html += fmt::format("<tr><td>{}<td>{}<td>{}<td>{:.6g}<td>{:.2g}<td>{:.2g}<td>{}</tr>\n",
                          escaped(model), escaped(name), spread.values.size(),
                          data::median(spread.values), half_width, data::median(spread.sigmas),
                          escaped(unit_words(spread.unit)));
    }
  return html + "</table>\n";
}

std::string failures(const std::vector<CampaignLine>& lines) {
  std::string html;
  for (const CampaignLine& line : lines)
    if (failed(line))
      html += fmt::format("<tr><td>{}<td>{}<td>{}</tr>\n", escaped(as_utf8(line.record.name)),
                          line.record.exit_status, escaped(line.record.message));
  if (html.empty()) return {};
  return "<h2>Failed</h2>\n<table><tr><th>recording<th>exit status<th>reason</tr>\n" + html +
         "</table>\n";
}

/// A name as part of an address: what means something there, and what is not ASCII, in hexadecimal.
std::string in_address(const std::string& name) {
  std::string address;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                       c == '-' || c == '.' || c == '_' || c == '~';
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  return address;
}

std::string all_items(const std::vector<CampaignLine>& lines) {
  std::string html =
      "<h2>All recordings</h2>\n<table><tr><th>recording<th>status<th>model<th>found<th>noise "
      "&times;<th>whiteness p<th>time [s]<th>verdict</tr>\n";
  for (const CampaignLine& line : lines) {
    const std::string name = escaped(as_utf8(line.record.name));
    html += fmt::format("<tr><td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>\n",
                        line.record.done ? fmt::format("<a href=\"{}.trochoid/report.html\">{}</a>",
                                                       in_address(line.record.name), name)
                                         : name,
                        status_of(line), line.fit ? escaped(line.fit->model) : "",
                        line.record.done ? fmt::format("{} of {}", line.found, line.frames) : "",
                        line.fit ? short_number(line.fit->noise_scale) : "",
                        line.fit ? short_number(line.fit->whiteness_p) : "",
                        line.known ? fmt::format("{:.2f}", line.record.seconds) : "",
                        escaped(line.record.done ? line.record.verdict : line.record.message));
  }
  return html + "</table>\n";
}

}  // namespace

std::string summary_csv(const std::vector<CampaignLine>& lines) {
  const std::vector<std::string> names = parameter_names(lines);
  std::string csv =
      "name,status,exit_status,grade,model,converged,frames,found,chi2,dof,noise_scale,"
      "whiteness_p,seconds,peak_mb";
  for (const std::string& name : names) csv += fmt::format(",{0},sigma_{0}", name);
  csv += ",video_sha256,version,message\n";
  for (const CampaignLine& line : lines) {
    const CampaignRecord& r = line.record;
    csv += fmt::format("{},{},{},{},{},{},{},{},", csv_text(as_utf8(r.name)), status_of(line),
                       line.known ? fmt::format("{}", r.exit_status) : "", r.grade,
                       line.fit ? line.fit->model : "", line.fit ? line.fit->converged : 0,
                       line.frames, line.found);
    csv += line.fit
               ? fmt::format("{},{},{},{},", csv_number(line.fit->chi2), line.fit->dof,
                             csv_number(line.fit->noise_scale), csv_number(line.fit->whiteness_p))
               : ",,,,";
    csv += fmt::format("{:.3f},{:.0f}", r.seconds, r.peak_mb);
    for (const std::string& name : names) {
      const data::FitParameter* p = line.fit ? line.fit->find(name) : nullptr;
      csv += p != nullptr && p->identifiable
                 ? fmt::format(",{},{}", csv_number(p->value), csv_number(p->sigma))
                 : ",,";
    }
    csv += fmt::format(",{},{},{}\n", r.inputs.empty() ? "" : r.inputs.front().second, r.version,
                       csv_text(r.message));
  }
  return csv;
}

std::string summary_html(const Campaign& campaign, const std::vector<CampaignLine>& lines) {
  std::map<std::string, int> counts;
  double seconds = 0.0;
  for (const CampaignLine& line : lines) {
    ++counts[status_of(line)];
    seconds += line.record.seconds;
  }
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font:15px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em}}"
      "table{{border-collapse:collapse}}td,th{{border-bottom:1px solid #ccc;padding:.2em .7em;"
      "text-align:left;vertical-align:top}}</style>\n<h1>{0}</h1>\n<p>{1} recordings:",
      escaped(campaign.manifest.filename().string()), lines.size());
  for (const auto& [status, count] : counts) html += fmt::format(" {} {};", count, status);
  html += fmt::format(
      " {:.3g} s of computing. Made by trochoid {}; each recording's command, "
      "version and checksums are in records/.</p>\n",
      seconds, TROCHOID_VERSION);
  return html + failures(lines) + spread_table(lines) + all_items(lines) + "</html>\n";
}

}  // namespace trochoid::tools
