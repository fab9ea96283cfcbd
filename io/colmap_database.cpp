#include "io/colmap_database.h"

#include <sqlite3.h>

#include <bit>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::io {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "COLMAP's blobs are little-endian");

// Columns in the order in which COLMAP 3.8 reads them; it adds what is missing (descriptors).
constexpr const char* kTables = R"(
  CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY NOT NULL, model INTEGER NOT NULL, width INTEGER NOT NULL,
    height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
  CREATE TABLE images (image_id INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL,
    prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL, prior_tx REAL, prior_ty REAL, prior_tz REAL);
  CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
  CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
  CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL,
    data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
)";
constexpr int kOpenCvModel = 4;
constexpr int kCalibrated = 2;  // kind of two-view geometry: of cameras with known focal lengths
constexpr std::int64_t kPairFactor = 2147483647;

class Database {
 public:
  Database(const fs::path& temporary, const fs::path& path) : path_(path.string()) {
    sqlite3* handle = nullptr;
    const int code = sqlite3_open(temporary.c_str(), &handle);
    handle_.reset(handle);
    Check(code);
  }
  void Execute(const char* sql) { Check(sqlite3_exec(handle_.get(), sql, nullptr, nullptr, nullptr)); }

  /// Runs one statement with its values bound in order.
  template <typename... Values>
  void Insert(const char* sql, const Values&... values) {
    sqlite3_stmt* raw = nullptr;
    Check(sqlite3_prepare_v2(handle_.get(), sql, -1, &raw, nullptr));
    const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(raw, sqlite3_finalize);
    int place = 0;
    (Bind(raw, ++place, values), ...);
    const int code = sqlite3_step(raw);
    Check(code == SQLITE_DONE ? SQLITE_OK : code);
  }

 private:
  void Bind(sqlite3_stmt* statement, int place, std::int64_t value) {
    Check(sqlite3_bind_int64(statement, place, value));
  }
  void Bind(sqlite3_stmt* statement, int place, const std::string& text) {
    Check(sqlite3_bind_text64(statement, place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  template <typename T>
  void Bind(sqlite3_stmt* statement, int place, const std::vector<T>& blob) {
    Check(sqlite3_bind_blob64(statement, place, blob.data(), sizeof(T) * blob.size(), SQLITE_TRANSIENT));
  }
  void Check(int code) {
    Require(code == SQLITE_OK, "cannot write " + path_ + ": " +
                                   (handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code)) +
                                   ": check that the folder exists, is writable and has room");
  }

  std::string path_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> handle_{nullptr, sqlite3_close};
};

void InsertCameras(Database& database, const std::vector<Camera>& cameras, const std::string& where) {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const Intrinsics& k = cameras[c].intrinsics;
    Require(k[8] == 0, where + ": camera " + cameras[c].serial + " has a k3, COLMAP's OPENCV has none");
    std::vector<double> parameters(k.data(), k.data() + 8);
    parameters[2] += 0.5;
    parameters[3] += 0.5;
    database.Insert("INSERT INTO cameras VALUES (?, ?, ?, ?, ?, 1)", std::int64_t(c) + 1, std::int64_t{kOpenCvModel},
                    std::int64_t{cameras[c].width}, std::int64_t{cameras[c].height}, parameters);
  }
}

void InsertImages(Database& database, const ColmapModel& model, const std::string& where) {
  std::set<std::string> names;
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    const ColmapImage& image = model.images[i];
    Require(names.insert(image.name).second, where + ": image " + image.name + " is there twice");
    Require(image.camera >= 0 && image.camera < static_cast<int>(model.cameras.size()),
            where + ": image " + image.name + " is of a camera that the model does not have");
    const auto id = static_cast<std::int64_t>(i + 1);
    database.Insert("INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)", id, image.name,
                    std::int64_t{image.camera} + 1);
    std::vector<float> keypoints;
    for (const ColmapPixel& seen : image.pixels) {
      keypoints.push_back(static_cast<float>(seen.pixel.x() + 0.5));
      keypoints.push_back(static_cast<float>(seen.pixel.y() + 0.5));
    }
    database.Insert("INSERT INTO keypoints VALUES (?, ?, 2, ?)", id,
                    static_cast<std::int64_t>(image.pixels.size()), keypoints);
  }
}

void InsertMatches(Database& database, const std::vector<ColmapImage>& images, int min_matches) {
  for (std::size_t a = 0; a < images.size(); ++a) {
    std::unordered_map<int, std::uint32_t> place;
    for (std::uint32_t k = 0; k < images[a].pixels.size(); ++k) {
      if (images[a].pixels[k].point >= 0) place[images[a].pixels[k].point] = k;
    }
    for (std::size_t b = a + 1; b < images.size(); ++b) {
      std::vector<std::uint32_t> matches;
      for (std::uint32_t k = 0; k < images[b].pixels.size(); ++k) {
        const auto found = place.find(images[b].pixels[k].point);
        if (found != place.end()) matches.insert(matches.end(), {found->second, k});
      }
      const auto count = static_cast<std::int64_t>(matches.size() / 2);
      if (count < min_matches) continue;
      const std::int64_t pair = static_cast<std::int64_t>(a + 1) * kPairFactor + static_cast<std::int64_t>(b + 1);
      database.Insert("INSERT INTO matches VALUES (?, ?, 2, ?)", pair, count, matches);
      database.Insert("INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) VALUES (?, ?, 2, ?, ?)", pair,
                      count, matches, std::int64_t{kCalibrated});
    }
  }
}

}  // namespace

void WriteColmapDatabase(const fs::path& path, const ColmapModel& model, int min_matches) {
  WriteAtomically(path, [&](const fs::path& temporary) {
    Database database(temporary, path);
    // A file that is thrown away unless whole needs neither journal nor waits for the disk.
    database.Execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; BEGIN");
    database.Execute(kTables);
    InsertCameras(database, model.cameras, path.string());
    InsertImages(database, model, path.string());
    InsertMatches(database, model.images, min_matches);
    database.Execute("COMMIT");
  });
}

}  // namespace sole::io
