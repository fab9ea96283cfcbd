#include "app/pseudonym.h"

#include <gtest/gtest.h>

namespace sole::app {
namespace {

TEST(LooksLikeFullName, NamesHoweverTheyAreJoined) {
  for (const char* name : {"Anna Meier", "anna meier", "Meier, Anna", "anna.meier", "Anna_Maria-Meier",
                           "AnnaMeier", "J. Smith", "Jürgen Müller", "Conan O'Brien"}) {
    EXPECT_TRUE(LooksLikeFullName(name)) << name;
  }
}

TEST(LooksLikeFullName, PseudonymsPass) {
  for (const char* name : {"S017", "P-07", "simulated", "subject 12", "A", "kiwi", "KIWI", "S1 left foot", "x/y z",
                           "", "A B"}) {
    EXPECT_FALSE(LooksLikeFullName(name)) << name;
  }
}

}  // namespace
}  // namespace sole::app
