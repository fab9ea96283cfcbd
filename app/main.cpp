#include <csignal>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/commands.h"
#include "app/console.h"
#include "core/error.h"

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error like a full disk

  CLI::App app{"Sole: records feet in motion and turns them into fitted, measured, exportable models."};
  app.name("sole");
  app.set_version_flag("--version", std::string(sole::app::Version()));
  app.require_subcommand(1);
  app.fallthrough();
  sole::app::CommonOptions common;
  app.add_option("--threads", common.threads, "Number of threads for every stage; 0 takes all cores")
      ->check(CLI::Range(0, 1024));
  app.add_flag("--json", common.json, "Print the result as JSON on stdout; everything else goes to stderr");
  int status = 0;
  sole::app::AddCommands(app, common, status);
  try {
    app.parse(argc, argv);
    return status;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const sole::Error& error) {
    std::fprintf(stderr, "sole: %s\n", error.what());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "sole: out of memory: use fewer cameras, frames or threads\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sole: %s\n", error.what());
  }
  return 1;
}
