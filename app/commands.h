#pragma once

namespace CLI {
class App;
}

namespace sole::app {

/// What every command understands.
struct CommonOptions {
  int threads = 0;
  bool json = false;
};

/// Registers every command; running one sets `status` (the exit status) or throws Error.
void AddCommands(CLI::App& app, CommonOptions& common, int& status);

// One function per file commands_*.cpp.
void AddSimCommands(CLI::App& app, CommonOptions& common, int& status);
/// Below `sim`.
void AddPeopleCommands(CLI::App& sim, CommonOptions& common, int& status);
void AddScansCommand(CLI::App& sim, CommonOptions& common, int& status);
void AddCaptureCommands(CLI::App& app, CommonOptions& common, int& status);
void AddTakeCommands(CLI::App& app, CommonOptions& common, int& status);
void AddCalibrateCommands(CLI::App& app, CommonOptions& common, int& status);
void AddTargetCommands(CLI::App& app, CommonOptions& common, int& status);
/// Below `calibrate`.
void AddGroundCommand(CLI::App& calibrate, CommonOptions& common, int& status);
void AddColmapCommands(CLI::App& calibrate, CommonOptions& common, int& status);
void AddProcessingCommands(CLI::App& app, CommonOptions& common, int& status);
/// `fit`, in its place among the processing commands.
void AddFitCommand(CLI::App& app, CommonOptions& common, int& status);
void AddMatchCommand(CLI::App& app, CommonOptions& common, int& status);
void AddDatasetCommands(CLI::App& app, CommonOptions& common, int& status);
void AddTrainCommand(CLI::App& app, CommonOptions& common, int& status);
void AddModelCommands(CLI::App& app, CommonOptions& common, int& status);

}  // namespace sole::app
