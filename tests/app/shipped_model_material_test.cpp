#include <gtest/gtest.h>

#include <filesystem>

#include "app/tools/simulated_people.h"
#include "model/model_file.h"
#include "model/train_person.h"
#include "model/vertex_fit.h"

namespace sole::tools {
namespace {

/// The shipped model names points of the simulator's reference foot: after a change of that foot it
/// has to be made again.
TEST(ShippedModelMaterial, BelongsToTheReferenceFootOfThisProgram) {
  const model::FootModel foot =
      model::LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / "sole-foot.npz");
  const Eigen::MatrixX3d target = PointsOn(sim::ReferenceFoot().vertices, foot.material);
  const model::VertexFitResult fit =
      FitVertices(foot, model::Variant::kCoarse, target, RigidStart(foot, target));
  EXPECT_LT(fit.mean_distance_m, 0.001);
  EXPECT_LT(fit.max_distance_m, 0.006);
}

}  // namespace
}  // namespace sole::tools
