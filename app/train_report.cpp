#include "app/train_report.h"

#include <fmt/format.h>

#include <vector>

#include "app/line_plot.h"
#include "io/atomic_file.h"

namespace sole::app {
namespace {

using nlohmann::json;

PlotLine Numbered(const std::string& name, const std::vector<double>& values) {
  PlotLine line{name, {}, values};
  for (std::size_t i = 0; i < values.size(); ++i) line.x.push_back(static_cast<double>(i + 1));
  return line;
}

std::string Number(const json& row, const char* key) {
  return row.contains(key) && row[key].is_number() ? fmt::format("{:.3f}", row[key].get<double>())
                                                   : "-";
}

std::string ValidationTable(const json& validation) {
  std::string html =
      "<table><tr><th>model</th><th>no contact, mm</th><th>contact, mm</th><th>no contact to truth, "
      "mm</th><th>contact to truth, mm</th></tr>\n";
  for (const char* name : {"lbs", "linear", "f_theta", "f_theta_beta", "full"}) {
    if (!validation.contains(name)) continue;
    const json& row = validation[name];
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", name,
                        Number(row, "noncontact_mm"), Number(row, "contact_mm"),
                        Number(row, "noncontact_truth_mm"), Number(row, "contact_truth_mm"));
  }
  html += "</table>\n";
  if (!validation.contains("full")) return html;
  const json& full = validation["full"];
  return html + fmt::format("<p>Told no contact, the network moves vertices that touch by {} mm; told "
                            "their contact it explains {} of the flattening; with contact fading in "
                            "{} of them rise steadily.</p>\n",
                            Number(full, "free_mm"), Number(full, "flattening_share"),
                            Number(full, "monotonic_share"));
}

}  // namespace

void WriteTrainReport(const std::filesystem::path& path, const json& account,
                      const std::map<std::string, LearningCurve>& curves) {
  std::string html =
      "<!DOCTYPE html><html><head><meta charset=\"utf-8\"><title>Training</title><style>"
      "body{font-family:sans-serif;max-width:60em;margin:2em auto}td,th{padding:.2em .8em;"
      "text-align:right}td:first-child,th:first-child{text-align:left}</style></head><body>\n"
      "<h1>Training of a foot model</h1>\n";
  html += fmt::format("<p>{} training subjects, {} registrations; {} validation subjects.{}</p>\n",
                      account["train_subjects"].get<int>(), account["train_frames"].get<int>(),
                      account["validation_subjects"].get<int>(),
                      account["truth"].get<bool>()
                          ? " Trained on the simulator's vertices: an upper bound."
                          : "");
  html += "<h2>Validation subjects, v2v</h2>\n" + ValidationTable(account["validation"]);
  for (const auto& [name, curve] : curves) {
    html += DrawLinePlot({"network " + name + ": error of a coordinate",
                          "epoch",
                          "mm",
                          {Numbered("training", curve.train_mm),
                           Numbered("validation", curve.validation_mm)}});
  }
  html += DrawLinePlot({"Variance of the training subjects explained",
                        "components",
                        "share",
                        {Numbered("shape", account["shape"]["explained"]),
                         Numbered("pose", account["pose_space"]["explained"])}});
  io::WriteStringAtomically(path, html + "</body></html>\n");
}

}  // namespace sole::app
