#pragma once

#include <string>

namespace sole::app {

/// Whether `subject` looks like a person's full name rather than a pseudonym: two to four words of
/// letters and nothing else, however they are joined ("Anna Meier", "meier,anna", "AnnaMeier").
bool LooksLikeFullName(const std::string& subject);

}  // namespace sole::app
