#include "app/export_colmap.h"

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "io/calibration_file.h"
#include "io/colmap_maps.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "recon/depth_map.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> ScansOf(const fs::path& take) {
  std::vector<fs::path> scans;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(take / "scans", none)) {
    if (entry.path().extension() == ".ply") scans.push_back(entry.path());
  }
  std::sort(scans.begin(), scans.end());
  return scans;
}

}  // namespace

fs::path ExportColmap(const fs::path& take) {
  const std::vector<fs::path> scans = ScansOf(take);
  Require(!scans.empty() && fs::exists(take / "calibration.json"),
          take.string() + " has no scans: run `sole reconstruct " + take.string() + " --calibration FILE` first");
  const Rig rig = io::ReadCalibration(take / "calibration.json").rig;
  const fs::path out = io::TakePaths{take}.Exports() / "colmap";
  int written = 0;
  for (const fs::path& scan : scans) {
    const PointCloud cloud = io::ReadPlyCloud(scan);
    if (cloud.Size() == 0) continue;
    std::vector<io::ColmapDenseView> views;
    for (const Camera& camera : rig.cameras) {
      recon::DepthMap map = recon::RenderDepthMap(cloud, camera);
      views.push_back({{map.camera, camera.serial + ".png"}, std::move(map.grey), std::move(map.depth_m),
                       std::move(map.normals)});
    }
    io::WriteColmapWorkspace(out / scan.stem(), views, cloud);
    ++written;
  }
  Require(written > 0, "no scan of " + take.string() + " has points: nothing to export");
  return out;
}

}  // namespace sole::app
