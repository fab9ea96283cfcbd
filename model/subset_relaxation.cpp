#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "model/subset_relaxation_internal.h"
#include "model/triangle_topology.h"

namespace sole::model {
namespace {

constexpr double kPoorQuality = 0.5;
constexpr int kRepairRings = 4;

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// The working state: `edit` has its own numbering (live vertices only); place[i] is the source
/// vertex it sits on.
class SubsetRelaxation {
 public:
  SubsetRelaxation(const TriangleMesh& source, std::vector<int> place, EditMesh edit,
                   std::span<const double> sizes)
      : source_(source),
        place_(std::move(place)),
        edit_(std::move(edit)),
        sizes_(sizes),
        neighbours_(NeighboursOfVertices(source.vertices.size(), source.triangles)),
        normals_(VertexNormals(source)),
        taken_(source.vertices.size(), false),
        on_rim_(source.vertices.size(), false) {
    for (const int v : place_) taken_[At(v)] = true;
    for (const std::vector<int>& loop : BoundaryLoops(source.triangles)) {
      for (const int v : loop) on_rim_[At(v)] = true;
    }
  }

  void Round() {
    FlipAll();
    for (int i = 0; i < static_cast<int>(place_.size()); ++i) Relax(i);
  }

  void FlipAll() {
    for (int u = 0; u < static_cast<int>(place_.size()); ++u) {
      for (const int v : edit_.Neighbours(u)) {
        if (u < v) MaybeFlip(u, v);
      }
    }
  }

  /// Moves the vertices of poor or folded triangles to the best of the source vertices around them.
  void Repair() {
    for (int i = 0; i < static_cast<int>(place_.size()); ++i) {
      if (FanScore(i) < kPoorQuality) TryAround(i);
    }
    FlipAll();
  }

  SubsetMesh Result() const {
    std::vector<int> order(place_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return place_[At(a)] < place_[At(b)]; });
    std::vector<int> rank(order.size());
    SubsetMesh subset;
    for (std::size_t r = 0; r < order.size(); ++r) {
      rank[At(order[r])] = static_cast<int>(r);
      subset.vertices.push_back(place_[At(order[r])]);
    }
    for (const Eigen::Vector3i& t : edit_.LiveTriangles()) {
      subset.triangles.emplace_back(rank[At(t[0])], rank[At(t[1])], rank[At(t[2])]);
    }
    return subset;
  }

 private:
  /// Cosine between the triangle's normal and the source's at its corners, the least of three.
  double Facing(int a, int b, int c) const {
    const Eigen::Vector3d normal = (edit_.Position(b) - edit_.Position(a))
                                       .cross(edit_.Position(c) - edit_.Position(a))
                                       .stableNormalized();
    double facing = 1;
    for (const int i : {a, b, c})
      facing = std::min(facing, normal.dot(normals_[At(place_[At(i)])]));
    return facing;
  }

  double Score(int a, int b, int c) const {
    const double quality = TriangleQuality(edit_.Position(a), edit_.Position(b), edit_.Position(c));
    return quality + std::min(0.0, Facing(a, b, c) - 0.5);
  }

  void MaybeFlip(int u, int v) {
    const std::vector<int> shared = edit_.TrianglesOfEdge(u, v);
    if (shared.size() != 2) return;
    // Oriented so that the first triangle runs u -> v -> a.
    int a = -1, b = -1;
    for (const int t : shared) {
      const Eigen::Vector3i& c = edit_.Triangle(t);
      for (int corner = 0; corner < 3; ++corner) {
        if (c[corner] == u && c[(corner + 1) % 3] == v) a = c[(corner + 2) % 3];
        if (c[corner] == v && c[(corner + 1) % 3] == u) b = c[(corner + 2) % 3];
      }
    }
    if (a < 0 || b < 0 || (edit_.OnBoundary(a) && edit_.OnBoundary(b))) return;
    const double before = std::min(Score(u, v, a), Score(v, u, b));
    const double after = std::min(Score(a, b, v), Score(b, a, u));
    if (after > before + 1e-6) edit_.Flip(u, v);
  }

  Eigen::Vector3d WantedPosition(int i) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double total = 0;
    for (const int t : edit_.TrianglesOf(i)) {
      const Eigen::Vector3i& c = edit_.Triangle(t);
      const Eigen::Vector3d p0 = edit_.Position(c[0]), p1 = edit_.Position(c[1]),
                            p2 = edit_.Position(c[2]);
      const double size = (sizes_[At(place_[At(c[0])])] + sizes_[At(place_[At(c[1])])] +
                           sizes_[At(place_[At(c[2])])]) /
                          3;
      const double weight = (p1 - p0).cross(p2 - p0).norm() / std::pow(size, 4);
      sum += weight * (p0 + p1 + p2) / 3;
      total += weight;
    }
    if (total <= 0) return edit_.Position(i);
    const Eigen::Vector3d centroid = sum / total;
    const Eigen::Vector3d& normal = normals_[At(place_[At(i)])];
    return centroid - normal * normal.dot(centroid - edit_.Position(i));
  }

  Eigen::Vector3d WantedRimPosition(int i) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const int n : edit_.Neighbours(i)) {
      if (edit_.TrianglesOfEdge(i, n).size() == 1) sum += 0.5 * edit_.Position(n);
    }
    return sum;
  }

  /// Walks over the source from the vertex's place to the nearest free source vertex.
  int Nearest(int start, const Eigen::Vector3d& wanted, bool rim) const {
    int best = start;
    for (int at = start, step = 0; step < 100; ++step) {
      int next = at;
      for (const int n : neighbours_[At(at)]) {
        if (on_rim_[At(n)] != rim) continue;
        if ((source_.vertices[At(n)] - wanted).squaredNorm() <
            (source_.vertices[At(next)] - wanted).squaredNorm())
          next = n;
      }
      if (next == at) break;
      at = next;
      if (!taken_[At(at)]) best = at;
    }
    return best;
  }

  void Relax(int i) {
    const bool rim = edit_.OnBoundary(i);
    const int from = place_[At(i)];
    const int to = Nearest(from, rim ? WantedRimPosition(i) : WantedPosition(i), rim);
    if (to == from) return;
    const EditMesh::MoveEffect before = edit_.EffectOfMove(i, edit_.Position(i), -1);
    const EditMesh::MoveEffect after = edit_.EffectOfMove(i, source_.vertices[At(to)], -1);
    if (after.cosine < 0.5 || (after.quality < 0.3 && after.quality < before.quality)) return;
    Place(i, to);
  }

  /// Source vertices at most kRepairRings edges away.
  std::vector<int> Around(int start) const {
    std::vector<int> found = {start};
    std::size_t begin = 0;
    for (int ring = 0; ring < kRepairRings; ++ring) {
      const std::size_t end = found.size();
      for (std::size_t at = begin; at < end; ++at) {
        for (const int n : neighbours_[At(found[at])]) {
          if (std::find(found.begin(), found.end(), n) == found.end()) found.push_back(n);
        }
      }
      begin = end;
    }
    return found;
  }

  /// Least facing of the triangles around i (see Facing).
  double FacingAround(int i) const {
    double facing = 1;
    for (const int t : edit_.TrianglesOf(i)) {
      const Eigen::Vector3i& c = edit_.Triangle(t);
      facing = std::min(facing, Facing(c[0], c[1], c[2]));
    }
    return facing;
  }

  /// Least quality of the triangles around i, less where one of them is turned over.
  double FanScore(int i) const {
    const double quality = edit_.EffectOfMove(i, edit_.Position(i), -1).quality;
    return quality + std::min(0.0, FacingAround(i));
  }

  void TryAround(int i) {
    const int from = place_[At(i)];
    int best = from;
    double best_score = FanScore(i);
    for (const int to : Around(from)) {
      if (to == from || taken_[At(to)] || on_rim_[At(to)] != on_rim_[At(from)]) continue;
      Place(i, to);
      const double score = FanScore(i);
      Place(i, from);
      if (score <= best_score) continue;
      best = to;
      best_score = score;
    }
    Place(i, best);
  }

  void Place(int i, int to) {
    taken_[At(place_[At(i)])] = false;
    taken_[At(to)] = true;
    place_[At(i)] = to;
    edit_.Move(i, source_.vertices[At(to)]);
  }

  const TriangleMesh& source_;
  std::vector<int> place_;
  EditMesh edit_;
  std::span<const double> sizes_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<Eigen::Vector3d> normals_;
  std::vector<bool> taken_, on_rim_;
};

}  // namespace

SubsetMesh RelaxSubset(const TriangleMesh& source, EditMesh& edit, std::span<const double> sizes,
                       int rounds) {
  std::vector<int> place, compact(edit.NumVertices(), -1);
  std::vector<Eigen::Vector3d> positions;
  for (int v = 0; v < static_cast<int>(edit.NumVertices()); ++v) {
    if (!edit.Alive(v)) continue;
    compact[At(v)] = static_cast<int>(place.size());
    place.push_back(v);
    positions.push_back(edit.Position(v));
  }
  std::vector<Eigen::Vector3i> triangles = edit.LiveTriangles();
  for (Eigen::Vector3i& t : triangles)
    t = Eigen::Vector3i(compact[At(t[0])], compact[At(t[1])], compact[At(t[2])]);
  SubsetRelaxation relaxation(source, place, EditMesh(positions, triangles), sizes);
  for (int round = 0; round < rounds; ++round) relaxation.Round();
  for (int round = 0; round < 3; ++round) relaxation.FlipAll();
  for (int round = 0; round < 5; ++round) relaxation.Repair();
  return relaxation.Result();
}

}  // namespace sole::model
