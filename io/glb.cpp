#include "io/glb.h"

#include <sstream>

#include <tiny_gltf.h>

#include "core/error.h"
#include "core/mesh.h"
#include "io/atomic_file.h"

namespace sole::io {
namespace {

using RowsF = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// World frame (z up) to glTF's (y up).
Eigen::Vector3d ToYUp(const Eigen::Vector3d& v) { return {v.x(), v.z(), -v.y()}; }

void Check(const MeshAnimation& animation, const std::string& where) {
  Require(
      !animation.frames.empty() && animation.frames[0].rows() > 0 && !animation.triangles.empty(),
      where + ": nothing to write: the mesh is empty");
  Require(animation.rate_hz > 0, where + ": the frame rate must be positive");
  const Eigen::Index count = animation.frames[0].rows();
  for (const Eigen::MatrixX3d& frame : animation.frames) {
    Require(frame.rows() == count, where + ": frames differ in their number of vertices");
    Require(frame.allFinite(),
            where + ": a frame holds values that are not finite: leave out frames without a foot");
  }
  for (const Eigen::Vector3i& t : animation.triangles) {
    Require(t.minCoeff() >= 0 && t.maxCoeff() < count,
            where + ": a triangle names a vertex that does not exist");
  }
  Require(animation.colours.empty() || animation.colours.size() == static_cast<std::size_t>(count),
          where + ": needs one colour per vertex or none");
}

/// Positions and unit normals of one frame in glTF's axes.
struct FrameData {
  RowsF positions;
  RowsF normals;
};

FrameData Convert(const MeshAnimation& animation, const Eigen::MatrixX3d& frame) {
  TriangleMesh mesh{{}, animation.triangles};
  for (Eigen::Index i = 0; i < frame.rows(); ++i)
    mesh.vertices.push_back(ToYUp(frame.row(i).transpose()));
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  FrameData data{RowsF(frame.rows(), 3), RowsF(frame.rows(), 3)};
  for (Eigen::Index i = 0; i < frame.rows(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    data.positions.row(i) = mesh.vertices[at].cast<float>().transpose();
    // glTF asks for unit normals even where no triangle defines one.
    const bool defined = normals[at].squaredNorm() > 0.5;
    data.normals.row(i) =
        (defined ? normals[at] : Eigen::Vector3d::UnitY()).cast<float>().transpose();
  }
  return data;
}

/// Adds arrays to the one buffer of a glTF model.
class Packer {
 public:
  explicit Packer(tinygltf::Model& model) : model_(model) { model_.buffers.resize(1); }

  /// Returns the accessor's index. `target` is 0 for data that is no vertex or index array.
  int Add(const void* data, std::size_t bytes, std::size_t count, int component, int type,
          int target) {
    std::vector<unsigned char>& buffer = model_.buffers[0].data;
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = buffer.size();
    view.byteLength = bytes;
    view.target = target;
    const auto* from = static_cast<const unsigned char*>(data);
    buffer.insert(buffer.end(), from, from + bytes);
    model_.bufferViews.push_back(view);
    tinygltf::Accessor accessor;
    accessor.bufferView = static_cast<int>(model_.bufferViews.size()) - 1;
    accessor.componentType = component;
    accessor.count = count;
    accessor.type = type;
    model_.accessors.push_back(accessor);
    return static_cast<int>(model_.accessors.size()) - 1;
  }

  int AddVectors(const RowsF& rows) {
    return Add(rows.data(), static_cast<std::size_t>(rows.size()) * sizeof(float),
               static_cast<std::size_t>(rows.rows()), TINYGLTF_COMPONENT_TYPE_FLOAT,
               TINYGLTF_TYPE_VEC3, TINYGLTF_TARGET_ARRAY_BUFFER);
  }

  /// Positions carry their bounds.
  int AddPositions(const RowsF& rows) {
    const int index = AddVectors(rows);
    tinygltf::Accessor& accessor = model_.accessors.back();
    for (Eigen::Index c = 0; c < 3; ++c) {
      accessor.minValues.push_back(rows.col(c).minCoeff());
      accessor.maxValues.push_back(rows.col(c).maxCoeff());
    }
    return index;
  }

  int AddScalars(const std::vector<float>& values) {
    return Add(values.data(), values.size() * sizeof(float), values.size(),
               TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_SCALAR, 0);
  }

 private:
  tinygltf::Model& model_;
};

tinygltf::Primitive MakePrimitive(const MeshAnimation& animation, Packer& packer) {
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = 0;
  std::vector<std::uint32_t> indices;
  for (const Eigen::Vector3i& t : animation.triangles) {
    for (int i = 0; i < 3; ++i) indices.push_back(static_cast<std::uint32_t>(t[i]));
  }
  primitive.indices = packer.Add(indices.data(), indices.size() * sizeof(std::uint32_t),
                                 indices.size(), TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                 TINYGLTF_TYPE_SCALAR, TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  const FrameData first = Convert(animation, animation.frames[0]);
  primitive.attributes["POSITION"] = packer.AddPositions(first.positions);
  primitive.attributes["NORMAL"] = packer.AddVectors(first.normals);
  if (!animation.colours.empty()) {
    RowsF colours(static_cast<Eigen::Index>(animation.colours.size()), 3);
    for (Eigen::Index i = 0; i < colours.rows(); ++i) {
      colours.row(i) =
          animation.colours[static_cast<std::size_t>(i)].cwiseMax(0.0F).cwiseMin(1.0F).transpose();
    }
    primitive.attributes["COLOR_0"] = packer.AddVectors(colours);
  }
  for (std::size_t f = 1; f < animation.frames.size(); ++f) {
    const FrameData frame = Convert(animation, animation.frames[f]);
    primitive.targets.push_back(
        {{"POSITION", packer.AddPositions(frame.positions - first.positions)},
         {"NORMAL", packer.AddVectors(frame.normals - first.normals)}});
  }
  return primitive;
}

/// Frame k has weight 1 on its own target and 0 on all others; frame 0 is the base mesh.
tinygltf::Animation MakeAnimation(const MeshAnimation& animation, tinygltf::Model& model,
                                  Packer& packer) {
  const std::size_t frames = animation.frames.size();
  std::vector<float> times, weights(frames * (frames - 1), 0.0F);
  for (std::size_t f = 0; f < frames; ++f) {
    times.push_back(static_cast<float>(static_cast<double>(f) / animation.rate_hz));
    if (f > 0) weights[f * (frames - 1) + f - 1] = 1.0F;
  }
  tinygltf::AnimationSampler sampler;
  sampler.interpolation = "LINEAR";
  sampler.input = packer.AddScalars(times);
  model.accessors.back().minValues = {times.front()};
  model.accessors.back().maxValues = {times.back()};
  sampler.output = packer.AddScalars(weights);
  tinygltf::AnimationChannel channel;
  channel.sampler = 0;
  channel.target_node = 0;
  channel.target_path = "weights";
  tinygltf::Animation result;
  result.name = "take";
  result.samplers.push_back(sampler);
  result.channels.push_back(channel);
  return result;
}

tinygltf::Material MakeMaterial(bool coloured) {
  tinygltf::Material material;
  material.name = "skin";
  if (!coloured) material.pbrMetallicRoughness.baseColorFactor = {0.72, 0.55, 0.46, 1.0};
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 0.8;
  material.doubleSided = true;  // feet are open at the ankle
  return material;
}

}  // namespace

void WriteGlb(const std::filesystem::path& path, const MeshAnimation& animation) {
  Check(animation, path.string());
  tinygltf::Model model;
  Packer packer(model);
  model.asset.version = "2.0";
  model.asset.generator = "Sole";
  model.asset.extras = tinygltf::Value(tinygltf::Value::Object{
      {"units", tinygltf::Value(std::string("metres"))}, {"format_version", tinygltf::Value(1)}});
  model.materials.push_back(MakeMaterial(!animation.colours.empty()));
  tinygltf::Mesh mesh;
  mesh.name = "foot";
  mesh.primitives.push_back(MakePrimitive(animation, packer));
  mesh.weights.assign(animation.frames.size() - 1, 0.0);
  model.meshes.push_back(mesh);
  tinygltf::Node node;
  node.name = "foot";
  node.mesh = 0;
  model.nodes.push_back(node);
  if (animation.frames.size() > 1)
    model.animations.push_back(MakeAnimation(animation, model, packer));
  tinygltf::Scene scene;
  scene.nodes = {0};
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  std::ostringstream out;
  Require(tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, out, false, true),
          path.string() + ": cannot make the GLB file");
  WriteStringAtomically(path, out.str());
}

}  // namespace sole::io
