#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/people.h"
#include "io/atomic_file.h"

namespace sole::app {
namespace {

struct PeopleArguments {
  int count = 100;
  std::uint64_t seed = 1;
  std::string out;
};

void PeopleCommand(const PeopleArguments& a, const CommonOptions& common) {
  std::vector<Person> people;
  {
    Progress progress("people", a.count);
    people = MakePeople(a.count, a.seed, [&](int done) { progress.Set(done); });
  }
  io::WriteStringAtomically(a.out, PeopleCsv(people));
  const nlohmann::json comparison = ComparePeople(people);
  fmt::print("{}", common.json ? comparison.dump(2) + "\n" : FormatComparison(comparison));
}

}  // namespace

void AddPeopleCommands(CLI::App& sim, CommonOptions& common, int& status) {
  auto a = std::make_shared<PeopleArguments>();
  CLI::App* people = sim.add_subcommand("people", "Draws people, measures their feet, compares them with the survey");
  people->footer("Example: sole sim people --n 200 --seed 1 --out people.csv\n"
                 "The comparison of means, standard deviations and correlations goes to stdout (--json for programs).");
  people->add_option("--n", a->count, "People, both sexes together")->check(CLI::Range(1, 1000000))->capture_default_str();
  people->add_option("--seed", a->seed, "Seed of the first person; the next ones follow")->capture_default_str();
  people->add_option("--out", a->out, "CSV file")->required();
  people->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    PeopleCommand(*a, common);
    status = 0;
  });
}

}  // namespace sole::app
