#include "sim/reference/remesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace sole::sim {
namespace {

using Eigen::Vector3d;

/// An editable closed triangle mesh with vertex-to-triangle lists.
class Editor {
 public:
  Editor(const LabelledMesh& mesh, const RemeshTarget& target)
      : target_(target), vertices_(mesh.vertices), triangles_(mesh.triangles), labels_(mesh.labels) {
    around_.resize(vertices_.size());
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (const int v : triangles_[t]) Around(v).push_back(static_cast<int>(t));
    }
    alive_.assign(triangles_.size(), true);
  }

  void SplitLongEdges() {
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      if (!alive_[t]) continue;
      int longest = 0;
      double ratio = 0;
      for (int i = 0; i < 3; ++i) {
        const double r = Ratio(triangles_[t][i], triangles_[t][(i + 1) % 3]);
        if (r > ratio) ratio = r, longest = i;
      }
      if (ratio > 4.0 / 3.0) Split(triangles_[t][longest], triangles_[t][(longest + 1) % 3]);
    }
  }

  void CollapseShortEdges() {
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (int i = 0; i < 3 && alive_[t]; ++i) {
        const int a = triangles_[t][i], b = triangles_[t][(i + 1) % 3];
        if (Ratio(a, b) < 0.8 && !Collapse(a, b)) Collapse(b, a);
      }
    }
  }

  void FlipEdges() {
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      for (int i = 0; i < 3 && alive_[t]; ++i) Flip(triangles_[t][i], triangles_[t][(i + 1) % 3]);
    }
  }

  void Smooth(double amount) {
    std::vector<Vector3d> moved = vertices_;
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      if (around_[v].empty()) continue;
      const SkinKind kind = KindOf(static_cast<int>(v));
      Vector3d sum = Vector3d::Zero(), normal = Vector3d::Zero();
      double weight = 0;
      for (const int t : around_[v]) {
        const Vector3d cross = Cross(t);
        normal += cross;
        for (const int n : Triangle(t)) {
          if (n == static_cast<int>(v) || (kind == SkinKind::kRim && !IsRimEdge(static_cast<int>(v), n))) continue;
          const double w = 1 / target_.edge_m(At(n));
          sum += w * At(n);
          weight += w;
        }
      }
      if (weight <= 0) continue;
      Vector3d step = amount * (sum / weight - vertices_[v]);
      if (kind != SkinKind::kRim) {
        normal.normalize();
        step -= normal * normal.dot(step);
      }
      moved[v] = target_.project(vertices_[v] + step, kind);
    }
    vertices_ = std::move(moved);
  }

  LabelledMesh Compact() const {
    LabelledMesh mesh;
    std::vector<int> index(vertices_.size(), -1);
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      if (!alive_[t]) continue;
      Eigen::Vector3i triangle;
      for (int i = 0; i < 3; ++i) {
        int& to = index[static_cast<std::size_t>(triangles_[t][i])];
        if (to < 0) {
          to = static_cast<int>(mesh.vertices.size());
          mesh.vertices.push_back(At(triangles_[t][i]));
        }
        triangle[i] = to;
      }
      mesh.triangles.push_back(triangle);
      mesh.labels.push_back(labels_[t]);
    }
    return mesh;
  }

 private:
  std::vector<int>& Around(int v) { return around_[static_cast<std::size_t>(v)]; }
  const std::vector<int>& Around(int v) const { return around_[static_cast<std::size_t>(v)]; }
  const Vector3d& At(int v) const { return vertices_[static_cast<std::size_t>(v)]; }
  Eigen::Vector3i& Triangle(int t) { return triangles_[static_cast<std::size_t>(t)]; }
  const Eigen::Vector3i& Triangle(int t) const { return triangles_[static_cast<std::size_t>(t)]; }
  int Label(int t) const { return labels_[static_cast<std::size_t>(t)]; }

  static bool Has(const Eigen::Vector3i& t, int v) { return t[0] == v || t[1] == v || t[2] == v; }

  Vector3d Cross(int t) const {
    const Eigen::Vector3i& i = Triangle(t);
    return (At(i[1]) - At(i[0])).cross(At(i[2]) - At(i[0]));
  }

  double Ratio(int a, int b) const {
    return (At(a) - At(b)).norm() / target_.edge_m(0.5 * (At(a) + At(b)));
  }

  std::pair<int, int> EdgeTriangles(int a, int b) const {
    std::pair<int, int> found{-1, -1};
    for (const int t : Around(a)) {
      if (Has(Triangle(t), b)) (found.first < 0 ? found.first : found.second) = t;
    }
    return found;
  }

  int Opposite(int t, int a, int b) const {
    for (const int v : Triangle(t)) {
      if (v != a && v != b) return v;
    }
    return -1;
  }

  bool IsRimEdge(int a, int b) const {
    const auto [t, u] = EdgeTriangles(a, b);
    return u >= 0 && Label(t) != Label(u);
  }

  SkinKind KindOf(int v) const {
    bool skin = false, cap = false;
    for (const int t : Around(v)) (Label(t) == 0 ? skin : cap) = true;
    return skin && cap ? SkinKind::kRim : cap ? SkinKind::kCap : SkinKind::kSkin;
  }

  std::vector<int> Neighbours(int v) const {
    std::vector<int> result;
    for (const int t : Around(v)) {
      for (const int n : Triangle(t)) {
        if (n != v) result.push_back(n);
      }
    }
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

  void Remove(int v, int t) { std::erase(Around(v), t); }

  void Split(int a, int b) {
    const auto [t, u] = EdgeTriangles(a, b);
    const SkinKind kind = Label(t) != Label(u) ? SkinKind::kRim
                             : Label(t) == 1      ? SkinKind::kCap
                                                  : SkinKind::kSkin;
    const int m = static_cast<int>(vertices_.size());
    vertices_.push_back(target_.project(0.5 * (At(a) + At(b)), kind));
    around_.emplace_back();
    for (const int old : {t, u}) {
      const int c = Opposite(old, a, b);
      const int added = static_cast<int>(triangles_.size());
      Eigen::Vector3i half = Triangle(old);
      for (int& v : half) {
        if (v == a) v = m;
      }
      for (int& v : Triangle(old)) {
        if (v == b) v = m;
      }
      triangles_.push_back(half);
      labels_.push_back(Label(old));
      alive_.push_back(true);
      Remove(b, old);
      Around(b).push_back(added);
      Around(c).push_back(added);
      Around(m).push_back(added);
      Around(m).push_back(old);
    }
  }

  /// Merges a into b.
  bool Collapse(int a, int b) {
    const auto [t, u] = EdgeTriangles(a, b);
    if (u < 0) return false;
    const SkinKind kind_a = KindOf(a), kind_b = KindOf(b);
    if (kind_a == SkinKind::kRim && !(kind_b == SkinKind::kRim && IsRimEdge(a, b))) return false;
    const std::vector<int> of_a = Neighbours(a), of_b = Neighbours(b);
    std::vector<int> common;
    std::set_intersection(of_a.begin(), of_a.end(), of_b.begin(), of_b.end(), std::back_inserter(common));
    if (common.size() != 2) return false;
    for (const int c : common) {
      if (Around(c).size() <= 3) return false;
    }
    const Vector3d to = kind_a == kind_b ? target_.project(0.5 * (At(a) + At(b)), kind_b) : At(b);
    for (const int n : of_a) {
      if ((At(n) - to).norm() > 1.33 * target_.edge_m(0.5 * (At(n) + to))) return false;
    }
    for (const int v : {a, b}) {
      for (const int w : Around(v)) {
        if (w != t && w != u && !KeepsFacing(w, v, to)) return false;
      }
    }
    vertices_[static_cast<std::size_t>(b)] = to;
    for (const int dead : {t, u}) {
      alive_[static_cast<std::size_t>(dead)] = false;
      const Eigen::Vector3i corners = Triangle(dead);
      for (const int v : corners) Remove(v, dead);
    }
    for (const int w : Around(a)) {
      for (int& v : Triangle(w)) {
        if (v == a) v = b;
      }
      Around(b).push_back(w);
    }
    Around(a).clear();
    return true;
  }

  bool KeepsFacing(int t, int v, const Vector3d& to) const {
    const Vector3d before = Cross(t);
    std::array<Vector3d, 3> p;
    for (int i = 0; i < 3; ++i) p[static_cast<std::size_t>(i)] = Triangle(t)[i] == v ? to : At(Triangle(t)[i]);
    const Vector3d after = (p[1] - p[0]).cross(p[2] - p[0]);
    const double longest = std::max({(p[1] - p[0]).norm(), (p[2] - p[1]).norm(), (p[0] - p[2]).norm()});
    return before.dot(after) > 0.5 * before.norm() * after.norm() && after.norm() > 0.15 * longest * longest;
  }

  void Flip(int a, int b) {
    const auto [t, u] = EdgeTriangles(a, b);
    if (u < 0 || Label(t) != Label(u)) return;
    const int c = Opposite(t, a, b), d = Opposite(u, a, b);
    const auto excess = [&](int v, int change) {
      const int e = static_cast<int>(Around(v).size()) + change - 6;
      return e * e;
    };
    const int now = excess(a, 0) + excess(b, 0) + excess(c, 0) + excess(d, 0);
    const int then = excess(a, -1) + excess(b, -1) + excess(c, 1) + excess(d, 1);
    if (then >= now || Around(a).size() <= 4 || Around(b).size() <= 4) return;
    if (EdgeTriangles(c, d).first >= 0) return;
    const Vector3d old_normal = (Cross(t) + Cross(u)).normalized();
    if (Cross(t).normalized().dot(Cross(u).normalized()) < 0.9) return;
    Eigen::Vector3i first = Triangle(t), second = Triangle(u);
    for (int& v : first) {
      if (v == b) v = d;
    }
    for (int& v : second) {
      if (v == a) v = c;
    }
    for (const Eigen::Vector3i& f : {first, second}) {
      const Vector3d cross = (At(f[1]) - At(f[0])).cross(At(f[2]) - At(f[0]));
      const double longest = std::max({(At(f[1]) - At(f[0])).norm(), (At(f[2]) - At(f[1])).norm(), (At(f[0]) - At(f[2])).norm()});
      if (cross.dot(old_normal) < 0.8 * cross.norm() || cross.norm() < 0.3 * longest * longest) return;
    }
    Triangle(t) = first;
    Triangle(u) = second;
    Remove(b, t);
    Remove(a, u);
    Around(d).push_back(t);
    Around(c).push_back(u);
  }

  const RemeshTarget& target_;
  std::vector<Vector3d> vertices_;
  std::vector<Eigen::Vector3i> triangles_;
  std::vector<int> labels_;
  std::vector<bool> alive_;
  std::vector<std::vector<int>> around_;
};

}  // namespace

LabelledMesh Remesh(const LabelledMesh& mesh, const RemeshTarget& target, int iterations) {
  LabelledMesh result = mesh;
  for (int i = 0; i < iterations; ++i) {
    Editor editor(result, target);
    editor.SplitLongEdges();
    editor.CollapseShortEdges();
    editor.FlipEdges();
    editor.Smooth(0.6);
    if (i + 1 == iterations) {
      for (int k = 0; k < 5; ++k) editor.Smooth(0.4);
    }
    result = editor.Compact();
  }
  return result;
}

}  // namespace sole::sim
