#pragma once

#include <cmath>
#include <limits>
#include <string>

#include <nlohmann/json.hpp>

#include "core/error.h"

namespace sole::io {

using Json = nlohmann::ordered_json;

/// Parses `text`; throws Error "<where>: ..." with line and column if it is not JSON.
inline Json ParseJson(const std::string& text, const std::string& where) {
  try {
    return Json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    const std::string what = error.what();
    const std::size_t at = what.find("] ");
    throw Error(where +
                ": is not valid JSON: " + (at == std::string::npos ? what : what.substr(at + 2)));
  }
}

/// Serialises with two spaces of indent; text that is not UTF-8 is replaced, never fatal.
inline std::string FormatJson(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

/// A member of an object; throws Error naming the key if it is absent or of another type.
inline const Json& Member(const Json& json, const char* key, const std::string& where) {
  Require(json.is_object() && json.contains(key), where + ": key '" + key + "' is missing");
  return json.at(key);
}

template <typename T>
T Get(const Json& json, const char* key, const std::string& where) {
  const Json& member = Member(json, key, where);
  constexpr bool kText = std::is_same_v<T, std::string>;
  const bool fits = kText                   ? member.is_string()
                    : std::is_integral_v<T> ? member.is_number_integer()
                                            : member.is_number();
  Require(fits, where + ": key '" + key + "' must be " +
                    (kText                   ? "text"
                     : std::is_integral_v<T> ? "an integer"
                                             : "a number"));
  if constexpr (std::is_integral_v<T>) {
    const double value = member.get<double>();
    Require(value >= static_cast<double>(std::numeric_limits<T>::min()) &&
                value <= static_cast<double>(std::numeric_limits<T>::max()),
            where + ": key '" + key + "' is out of range");
  }
  return member.get<T>();
}

/// A number or null, which stands for NaN (a figure that was not computed).
inline double GetOrNan(const Json& json, const char* key, const std::string& where) {
  return Member(json, key, where).is_null() ? std::numeric_limits<double>::quiet_NaN()
                                            : Get<double>(json, key, where);
}

inline Json NumberOrNull(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

}  // namespace sole::io
