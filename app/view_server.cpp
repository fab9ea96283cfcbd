#include "app/view_server.h"

#include <chrono>
#include <mutex>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <httplib.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace sole::app {
namespace {

using nlohmann::json;

constexpr int kPictureWidth = 640;

constexpr const char* kPage = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Sole: live view</title>
<style>
body{font:14px system-ui,sans-serif;background:#111;color:#ddd;margin:1em}
#cameras{display:grid;grid-template-columns:repeat(auto-fill,minmax(300px,1fr));gap:8px}
figure{margin:0;background:#1c1c1c;padding:6px}
figure.silent{outline:3px solid #c33}
img{width:100%;display:block;background:#000;min-height:80px}
figcaption{font-variant-numeric:tabular-nums;padding-top:4px}
h1{font-size:18px}
</style></head><body>
<h1 id="summary">connecting</h1><div id="cameras"></div>
<script>
const ms = s => (1000 * s).toFixed(1) + ' ms';
async function refresh() {
  try {
    const s = await (await fetch('/status.json')).json();
    document.getElementById('summary').textContent =
      `${s.phase}: ${s.fired}${s.triggers ? ' of ' + s.triggers : ''} triggers, ` +
      `${s.frames} frames stored, jitter ${ms(s.trigger_jitter_s)}, disk ${Math.round(s.disk_left_s)} s`;
    const grid = document.getElementById('cameras');
    s.cameras.forEach((c, i) => {
      let f = grid.children[i];
      if (!f) {
        f = document.createElement('figure');
        f.append(document.createElement('img'), document.createElement('figcaption'));
        f.children[0].onload = e => { f.dataset.width = e.target.naturalWidth; };
        grid.append(f);
      }
      f.className = c.silent ? 'silent' : '';
      f.children[0].alt = c.serial;
      f.children[0].src = `/camera/${i}.jpg?${Date.now()}`;
      f.children[1].textContent = `${c.serial}: ${c.frames} frames, ${c.lost} lost, ` +
        `${c.resent_packets} resent, saturated ${(100 * c.saturated).toFixed(2)} %, ` +
        `focus ${c.focus.toFixed(2)}, ${ms(c.latency_s)}` + (c.silent ? ', SILENT' : '');
    });
  } catch (e) {
    document.getElementById('summary').textContent = 'the recording has ended';
    return;
  }
  setTimeout(refresh, 500);
}
refresh();
</script></body></html>
)";

json ToJson(const capture::RecordProgress& progress) {
  json cameras = json::array();
  for (const capture::CameraStatus& c : progress.cameras) {
    cameras.push_back({{"serial", c.serial},
                       {"frames", c.frames},
                       {"lost", c.lost},
                       {"resent_packets", c.resent_packets},
                       {"saturated", c.saturated},
                       {"focus", c.focus},
                       {"queued", c.queued},
                       {"latency_s", c.latency_s},
                       {"sync_s", c.sync_s},
                       {"silent", c.silent},
                       {"reconnecting", c.reconnecting},
                       {"foot", c.foot}});
  }
  return {{"phase", capture::ToString(progress.phase)},
          {"fired", progress.fired},
          {"triggers", progress.triggers},
          {"frames", progress.frames},
          {"trigger_jitter_s", progress.trigger_jitter_s},
          {"disk_left_s", progress.disk_left_s},
          {"cameras", cameras}};
}

std::string ToJpeg(const ImageU8& image) {
  const cv::Mat whole(image.height, image.width, CV_8U,
                      const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat small = whole;
  if (image.width > kPictureWidth) {
    cv::resize(whole, small, {kPictureWidth, kPictureWidth * image.height / image.width}, 0, 0,
               cv::INTER_AREA);
  }
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, 80});
  return {bytes.begin(), bytes.end()};
}

}  // namespace

struct ViewServer::State {
  httplib::Server server;
  std::thread thread;
  int port = 0;
  std::mutex mutex;
  capture::RecordProgress progress;
  std::vector<ImageU8> pictures;

  void Route() {
    server.Get("/", [](const httplib::Request&, httplib::Response& response) {
      response.set_content(kPage, "text/html; charset=utf-8");
    });
    server.Get("/status.json", [this](const httplib::Request&, httplib::Response& response) {
      const std::lock_guard lock(mutex);
      response.set_content(ToJson(progress).dump(), "application/json");
    });
    server.Get(R"(/camera/(\d{1,4})\.jpg)",
               [this](const httplib::Request& request, httplib::Response& response) {
                 const auto camera = static_cast<std::size_t>(std::stoi(request.matches[1]));
                 ImageU8 image;
                 {
                   const std::lock_guard lock(mutex);
                   if (camera < pictures.size()) image = pictures[camera];
                 }
                 if (image.Empty()) {
                   response.status = 404;
                   return;
                 }
                 response.set_header("Cache-Control", "no-store");
                 response.set_content(ToJpeg(image), "image/jpeg");
               });
  }
};

ViewServer::ViewServer(int port) : state_(std::make_unique<State>()) {
  state_->server.new_task_queue = [] { return new httplib::ThreadPool(2); };  // the cameras come first
  state_->Route();
  constexpr const char* kHere = "127.0.0.1";
  state_->port = port > 0 ? (state_->server.bind_to_port(kHere, port) ? port : -1)
                          : state_->server.bind_to_any_port(kHere);
  Require(state_->port > 0,
          fmt::format("cannot serve the live view on 127.0.0.1:{}: the port is in use, choose "
                      "another with --view PORT",
                      port));
  state_->thread = std::thread([this] { state_->server.listen_after_bind(); });
  while (!state_->server.is_running()) {  // stop() before that would be lost
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

ViewServer::~ViewServer() {
  state_->server.stop();
  state_->thread.join();
}

int ViewServer::Port() const { return state_->port; }

void ViewServer::Show(const capture::RecordProgress& progress) {
  const std::lock_guard lock(state_->mutex);
  state_->progress = progress;
}

void ViewServer::Show(const std::vector<ImageU8>& pictures) {
  const std::lock_guard lock(state_->mutex);
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (i >= state_->pictures.size()) state_->pictures.emplace_back();
    if (!pictures[i].Empty()) state_->pictures[i] = pictures[i];
  }
}

}  // namespace sole::app
