#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "app/train_config.h"
#include "model/train_person.h"

namespace sole::app {

/// The files of a dataset that training may open: subjects of the split `test` are not among them.
struct TrainingFiles {
  std::vector<std::filesystem::path> train, validation;
  std::string fingerprint;  ///< names and sizes of these files
};
TrainingFiles ListTrainingFiles(const std::filesystem::path& dataset);

/// One subject as right feet: registrations that are good and whole, left ones mirrored.
struct TrainingSubject {
  std::string name;
  std::vector<model::TrainingFrame> frames;  ///< empty: too few, or not of the sex asked for
};

/// Throws Error where the file's template is another than the model's. With `truth` the coarse
/// vertices and the contact are the simulator's (Error where the file has no truth): the upper bound.
TrainingSubject ReadTrainingSubject(const std::filesystem::path& path,
                                    const model::FootModel& foot, const TrainConfig& config,
                                    bool truth);

/// A subject's fit as a checkpoint.
void WritePersonalFit(const std::filesystem::path& path, const model::PersonalFit& fit);
model::PersonalFit ReadPersonalFit(const std::filesystem::path& path);

/// Calls `make` for every file, a few at a time side by side, and `use` with what it made, one after
/// the other in the files' order: whatever the number of threads, sums come out the same, and no
/// more than a few subjects are in memory.
template <class Made>
void ForEachFile(const std::vector<std::filesystem::path>& files,
                 const std::function<Made(const std::filesystem::path&)>& make,
                 const std::function<void(const std::filesystem::path&, Made&)>& use) {
  constexpr std::size_t kBlock = 8;
  for (std::size_t begin = 0; begin < files.size(); begin += kBlock) {
    const std::size_t size = std::min(kBlock, files.size() - begin);
    std::vector<Made> made(size);
    tbb::parallel_for(std::size_t{0}, size,
                      [&](std::size_t i) { made[i] = make(files[begin + i]); });
    for (std::size_t i = 0; i < size; ++i) use(files[begin + i], made[i]);
  }
}

}  // namespace sole::app
