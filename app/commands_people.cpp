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
  int per_sex = 0;
  std::uint64_t seed = 1;
  std::string out;
};

void PeopleCommand(const PeopleArguments& a, const CommonOptions& common) {
  const std::vector<std::uint64_t> seeds = a.per_sex > 0 ? SeedsPerSex(a.per_sex, a.seed) : PeopleSeeds(a.count, a.seed);
  std::vector<Person> people;
  {
    Progress progress("people", static_cast<int>(seeds.size()));
    people = MakePeople(seeds, [&](int done) { progress.Set(done); });
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
                 "         sole sim people --per-sex 1000 --seed 1000 --out people.csv\n"
                 "The comparison of means, standard deviations and correlations goes to stdout (--json for programs).");
  CLI::Option* count = people->add_option("--n", a->count, "People, both sexes together")
                           ->check(CLI::Range(1, 1000000))->capture_default_str();
  people->add_option("--per-sex", a->per_sex, "Women and as many men, instead of --n")->check(CLI::Range(1, 500000))->excludes(count);
  people->add_option("--seed", a->seed, "Seed of the first person; the next ones follow")->capture_default_str();
  people->add_option("--out", a->out, "CSV file")->required();
  people->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    PeopleCommand(*a, common);
    status = 0;
  });
}

}  // namespace sole::app
